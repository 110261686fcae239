-- |
-- The paper's example in a mock world: prints what the robot does, in real time or in a
-- simulation.
module Main (main) where

import Data.Foldable (traverse_)
import Options.Applicative (handleParseResult)
import System.Environment (getArgs)
import System.Exit (exitWith)
import System.IO (BufferMode (..), hSetBuffering, stdout)

import Behavior
import Behavior.Live (viewEvents, viewing)
import Behavior.Sim (Schedule (..))
import Exploration
import Mission
import Options

main :: IO ()
main = do
  o <- getArgs >>= handleParseResult . parse
  hSetBuffering stdout LineBuffering -- so that a pipe gets each line at once
  how <- runBehavior $ case mode o of
    Really -> end <$> viewing (shown o) (mission o putStrLn)
    Simulated number -> do
      (report, m, recorded) <- simulatedWithEvents o (maybe NonPreemptive (Seeded . fromInteger) number)
      traverse_ putStrLn report
      viewEvents (shown o) recorded
      pure (maybe NotOver end m)
    Explored n -> do
      missions <- explored n o
      traverse_ putStrLn (reported missions)
      pure (worst missions)
  exitWith (status how)
