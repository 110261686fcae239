-- |
-- One mission of the robot, in reality or in a simulation.
module Mission
  ( Mission (..)
  , End (..)
  , inWords
  , status
  , mission
  , simulated
  ) where

import Control.Exception (ErrorCall (..), Handler (..), catches, displayException, throwIO)
import Data.IORef (modifyIORef, newIORef, readIORef)
import System.Exit (ExitCode (..))

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.STM (readTVarIO)
import Behavior.Sim (Outcome (..), Run (..), Schedule, defaults, explain, simulateWith)
import qualified Behavior.Sim as Sim
import WorldChange
import Options
import Programs (behavior)
import Robot (inWorld)
import Variation (variation)
import World

-- | What came of a mission.
data Mission = Mission
  { end :: !End
  , lasted :: !Seconds
  -- ^ In the time of the world.
  , lowest :: !Double
  -- ^ To what level the battery came down: percent.
  }
  deriving (Eq, Show)

-- | How a mission ended; the later in this list, the worse.
data End
  = TaskDone
  | TaskDoneOutside
  | RobotFailed
  | RanFlat
  | -- | After what would be an hour; of simulated missions only.
    NotOver
  deriving (Eq, Ord, Show, Enum, Bounded)

inWords :: End -> String
inWords how = case how of
  TaskDone -> "the task is done"
  TaskDoneOutside -> "the task is done, but not in the room"
  RobotFailed -> "the robot failed"
  RanFlat -> "fault of the world: " ++ displayException BatteryFlat
  NotOver -> "not over after what would be an hour: given up"

-- | The exit status that says so.
status :: End -> ExitCode
status how = case how of
  TaskDone -> ExitSuccess
  TaskDoneOutside -> ExitSuccess
  RobotFailed -> ExitFailure 1
  RanFlat -> ExitFailure 3
  NotOver -> ExitFailure 4

-- | Tells what the robot does, line by line as it happens, and how that ends.
mission :: Options -> (String -> Behavior ()) -> Behavior Mission
mission o tell = do
  factor <- maybe (pure (pure 1)) variation (seed o)
  world <- newWorld (settingOf o factor)
  let robot = firstOf [behavior (program o), flat world]
      story = inWorld world (narrating world (tell . describe) robot)
  (how, why) <-
    (story >> succeeded world)
      `catches` [Handler (failedWith world), Handler (\BatteryFlat -> pure (RanFlat, ""))]
  t <- clock world
  percent <- batteryNow world
  tell (line t percent (inWords how ++ why))
  -- The level falls but for when it is recharged, and then that begins.
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

-- | The failure that gets out is that of the last action that failed.
failedWith :: World -> BehaviorFailed -> Behavior (End, String)
failedWith world failure = do
  events <- happened world
  pure . (,) RobotFailed $
    case [" at \"" ++ action e ++ "\": " ++ why | e@WorldChange {changeKind = Fails why} <- events] of
      [] -> ": " ++ displayException failure
      places -> last places

-- | Runs the mission in virtual time, by this schedule. Gives the lines of its story, and
-- what came of it; nothing, if it would not be over after an hour.
--
-- (The lines are not printed meanwhile: a simulation must not wait for who reads them.)
simulated :: Options -> Schedule -> IO ([String], Maybe Mission)
simulated o schedule' = do
  told <- newIORef []
  run <- simulateWith options' (mission o (\text -> modifyIORef told (text :)))
  story <- reverse <$> readIORef told
  case outcome run of
    Returned m -> pure (story, Just m)
    OutOfTime -> notOver story
    Livelock _ -> notOver story -- the hour would never pass
    Faulting e -> throwIO e
    Cancelled e -> throwIO e
    other -> throwIO (ErrorCall ("the simulation: " ++ explain other))
 where
  notOver story = pure (story ++ [inWords NotOver], Nothing)
  options' =
    defaults
      { Sim.scheduled = schedule'
      , Sim.endAt = 3600 -- computed in seconds
      , Sim.realTimeLimit = 1 / 0 -- who waits can press Ctrl-C
      }
