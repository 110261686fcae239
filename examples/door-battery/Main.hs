-- |
-- The paper's example in a mock world: prints what the robot does, as it happens.
module Main (main) where

import Control.Concurrent.STM (readTVarIO)
import Control.Exception (Handler (..), catches, displayException)
import Options.Applicative (handleParseResult)
import System.Environment (getArgs)
import System.Exit (ExitCode (..), exitWith)
import System.IO (BufferMode (..), hSetBuffering, stdout)

import Behavior
import Behavior.Parallel (firstOf)
import Event
import Options
import Programs (behavior)
import Robot (inWorld)
import Variation (variation)
import World

main :: IO ()
main = do
  o <- getArgs >>= handleParseResult . parse
  hSetBuffering stdout LineBuffering -- whoever reads a pipe sees what happens as it happens
  factor <- maybe (pure (pure 1)) variation (seed o)
  world <- newWorld (settingOf o factor)
  let robot = firstOf [behavior (program o), flat world]
      story = inWorld world (narrating world (putStrLn . describe) robot)
  (runBehavior story >> succeeded world)
    `catches` [Handler (failedWith world), Handler (flatIn world)]

settingOf :: Options -> Behavior Double -> Setting
settingOf o factor =
  Setting
    { frontIs = front o
    , backIs = back o
    , chargedTo = fromIntegral (batteryPercent o)
    , drain = drainRate o
    , gain = chargeRate o
    , threshold = lowBelow o
    , speed = speedFactor o
    , lasting = taking (realToFrac . (* actionSeconds o) <$> factor)
    }

succeeded :: World -> IO ()
succeeded world = do
  inside <- readTVarIO (holds world InsideRoom)
  report world ("the task is done" ++ if inside then "" else ", but not in the room")

-- | The failure that gets out is that of the last action that failed.
failedWith :: World -> BehaviorFailed -> IO ()
failedWith world failure = do
  events <- happened world
  report world . ("the robot failed" ++) $
    case [" at \"" ++ action e ++ "\": " ++ why | e@Event {happening = Fails why} <- events] of
      [] -> ": " ++ displayException failure
      places -> last places
  exitWith (ExitFailure 1)

flatIn :: World -> BatteryFlat -> IO ()
flatIn world fault = do
  report world ("fault of the world: " ++ displayException fault)
  exitWith (ExitFailure 3)

report :: World -> String -> IO ()
report world what = do
  t <- clock world
  percent <- batteryNow world
  putStrLn (line t percent what)
