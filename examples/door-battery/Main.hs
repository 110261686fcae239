-- |
-- The paper's example in a mock world: prints what the robot does, as it happens; or,
-- in a simulation, what it would do.
module Main (main) where

import Data.Foldable (traverse_)
import Options.Applicative (handleParseResult)
import System.Environment (getArgs)
import System.Exit (exitWith)
import System.IO (BufferMode (..), hSetBuffering, stdout)

import Behavior
import Behavior.Sim (Schedule (..))
import Exploration
import Mission
import Options

main :: IO ()
main = do
  o <- getArgs >>= handleParseResult . parse
  hSetBuffering stdout LineBuffering -- whoever reads a pipe sees what happens as it happens
  how <- runBehavior $ case mode o of
    Really -> end <$> mission o putStrLn
    Simulated number -> do
      (story, m) <- simulated o (maybe NonPreemptive (Seeded . fromInteger) number)
      traverse_ putStrLn story
      pure (maybe NotOver end m)
    Explored n -> do
      missions <- explored n o
      traverse_ putStrLn (reported missions)
      pure (worst missions)
  exitWith (status how)
