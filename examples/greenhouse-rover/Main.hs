-- |
-- The greenhouse rover in its mock greenhouses, in real time: prints its log while it
-- works, and then its findings.
module Main (main) where

import qualified Data.Map.Strict as Map
import System.Environment (getArgs)
import System.Exit (die)
import System.IO (BufferMode (..), hSetBuffering, stdout)
import Text.Read (readMaybe)

import Beds
import Behavior
import Behavior.Parallel (fork, scoped)
import Behavior.STM (atomically)
import Behavior.Sim.Mock
import GreenhouseRover
import GreenhouseWorld

main :: IO ()
main = do
  hSetBuffering stdout LineBuffering
  pressed <- getArgs >>= emergencyFrom
  (_, mock) <-
    greenhouses
      calm
        { battery = [(0, 100), (3, 19.4), (3.5, 20.3)]
        , emergency = (0, False) : [(seconds, True) | seconds <- pressed]
        , bumps = [(0, False), (1.2, True)]
        , someone = [(0, False), (4, True), (6, False)]
        , pictures = \bed -> [hangs | bed == Bed North 1] ++ pictures calm bed
        , logged = putStrLn
        }
  let hardware = mock {armPark = armPark mock >> putStrLn "the motors are off, the arm is parked"}
  beds <- newBeds [Bed North 1]
  runBehavior . scoped $ \nursery -> do
    _ <- fork nursery (sleep 2 >> atomically (addBed beds (Bed South 1)))
    found <- rover hardware beds
    mapM_ print (Map.toList found)

-- | After how many seconds the emergency stop is pressed; never if there is no argument.
emergencyFrom :: [String] -> IO [Seconds]
emergencyFrom arguments = case (arguments, mapM readMaybe arguments) of
  ([], _) -> pure []
  (_, Just [seconds]) | seconds > 0 && seconds < 1e9 -> pure [realToFrac (seconds :: Double)]
  _ -> die "usage: greenhouse-rover [SECONDS until the emergency stop: a number greater than 0]"
