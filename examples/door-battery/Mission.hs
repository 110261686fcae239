-- |
-- One mission of the robot, in reality or in a simulation.
module Mission
  ( Mission (..)
  , End (..)
  , inWords
  , status
  , mission
  , simulated
  , simulatedWithEvents
  ) where

import Control.Exception (ErrorCall (..), Handler (..), catches, displayException, throwIO)
import Data.IORef (modifyIORef, newIORef, readIORef)
import System.Exit (ExitCode (..))

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.STM (readTVarIO)
import Behavior.Sim (Outcome (..), Run (..), Schedule, defaultSimOptions, explain, simulateWith)
import qualified Behavior.Sim as Sim
import Behavior.Trace (Event, named)
import Options
import Programs (behavior)
import Robot (inWorld)
import Variation (variation)
import World
import WorldChange

-- | The result of a mission.
data Mission = Mission
  { end :: !End
  , lasted :: !Seconds
  -- ^ In the time of the world.
  , lowest :: !Double
  -- ^ The lowest level of the battery: percent.
  }
  deriving (Eq, Show)

-- | How a mission ended, from best to worst.
data End
  = TaskDone
  | TaskDoneOutside
  | RobotFailed
  | RanFlat
  | -- | Still running after a simulated hour; for simulated missions only.
    NotOver
  deriving (Eq, Ord, Show, Enum, Bounded)

inWords :: End -> String
inWords how = case how of
  TaskDone -> "the task is done"
  TaskDoneOutside -> "the task is done, but not in the room"
  RobotFailed -> "the robot failed"
  RanFlat -> "fault of the world: " ++ displayException BatteryFlat
  NotOver -> "not over after what would be an hour: given up"

-- | The exit status for each end.
status :: End -> ExitCode
status how = case how of
  TaskDone -> ExitSuccess
  TaskDoneOutside -> ExitSuccess
  RobotFailed -> ExitFailure 1
  RanFlat -> ExitFailure 3
  NotOver -> ExitFailure 4

-- | Runs a mission, and passes each line of its report to the given function as it happens;
-- the last line is how it ended.
mission :: Options -> (String -> Behavior ()) -> Behavior Mission
mission o printLine = do
  factor <- maybe (pure (pure 1)) variation (seed o)
  world <- newWorld (settingOf o factor)
  let robot = firstOf [behavior (program o), flat world]
      narrated = named "mission" $ inWorld world (narrating world (printLine . describe) robot)
  (how, why) <-
    (narrated >> succeeded world)
      `catches` [Handler (failedWith world), Handler (\BatteryFlat -> pure (RanFlat, ""))]
  t <- clock world
  percent <- batteryNow world
  printLine (line t percent (inWords how ++ why))
  -- The level only falls, except while recharging. So the lowest one is at the beginning
  -- of a recharging, or at the end.
  levels <- map charge <$> happened world
  pure Mission {end = how, lasted = t, lowest = minimum (percent : levels)}

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

succeeded :: World -> Behavior (End, String)
succeeded world = do
  inside <- readTVarIO (holds world InsideRoom)
  pure (if inside then TaskDone else TaskDoneOutside, "")

-- | The failure that ends the mission is that of the last action that failed.
failedWith :: World -> BehaviorFailed -> Behavior (End, String)
failedWith world failure = do
  changes <- happened world
  pure . (,) RobotFailed $
    case [" at \"" ++ action e ++ "\": " ++ why | e@WorldChange {changeKind = Fails why} <- changes] of
      [] -> ": " ++ displayException failure
      places -> last places

-- | Runs the mission in virtual time, under this schedule. Returns the lines of its report,
-- and its result, or 'Nothing' if it is not over after an hour.
--
-- (The lines are not printed meanwhile: a simulation must not block on output.)
simulated :: Options -> Schedule -> IO ([String], Maybe Mission)
simulated o schedule = (\(report, m, _) -> (report, m)) <$> simulatedWithEvents o schedule

-- | The same, and the events of the run.
simulatedWithEvents :: Options -> Schedule -> IO ([String], Maybe Mission, [Event])
simulatedWithEvents o schedule = do
  printed <- newIORef []
  run <- simulateWith upToAnHour (mission o (\text -> modifyIORef printed (text :)))
  report <- reverse <$> readIORef printed
  case outcome run of
    Returned m -> pure (report, Just m, events run)
    OutOfTime _ -> notOver report run
    Livelock _ _ -> notOver report run -- the hour would never pass
    Threw e -> throwIO e
    other -> throwIO (ErrorCall ("the simulation: " ++ explain other))
 where
  notOver report run = pure (report ++ [inWords NotOver], Nothing, events run)
  upToAnHour =
    defaultSimOptions
      { Sim.scheduled = schedule
      , Sim.endAt = 3600 -- takes a few seconds of real time
      , Sim.realTimeLimit = 1 / 0 -- the user can press Ctrl-C
      }
