-- |
-- A drone that surveys a field. A planner changes its path while it flies. It comes home when the
-- survey is done, when the time is up, and when the battery is low; in strong wind it lands where
-- it is. Whatever happens, it lands once, and its motors are switched off after that.
module Drone
  ( Drone (..)
  , Waypoint
  , drone
  , survey
  ) where

import Control.Exception (bracket_, displayException)
import Control.Monad (forever)
import Data.List (intercalate)

import Behavior
import Behavior.STM
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Time (cleanupWithin, timeout)

type Waypoint = String

-- | The hardware. @main@ fills this record with drivers, and a test with a mock.
data Drone = Drone
  { motorsOn, takeOff, land, motorsOff :: Behavior ()
  , flyTo :: Waypoint -> Behavior ()
  , home :: Waypoint
  , film :: Behavior ()
  -- ^ Films until it is cancelled. The driver may fault, even while it stops.
  , firstPath :: [Waypoint]
  , nextPath :: Behavior [Waypoint]
  -- ^ Waits until the path has to change, computes, and gives the rest of the new path.
  , timeLimit :: Seconds
  , strongWind, batteryLow :: Signal Bool
  , logLine :: String -> Behavior ()
  }

-- | The mission. The landing is the cleanup of the flight, and nothing else lands: so each way in
-- which a flight can end (result, failure, fault, cancellation) has one landing, and nothing
-- interrupts that. With @land@ as the emergency of 'Signal.insteadWhen', a cancellation could stop it
-- in the air.
drone :: Drone -> Behavior ()
drone robot = bracket_ (motorsOn robot) (cleanupWithin (1 / 0) (land robot >> motorsOff robot)) $
  Signal.insteadWhen (strongWind robot) (logLine robot "strong wind: land here") $ do
    takeOff robot
    Signal.insteadWhen (batteryLow robot) (logLine robot "the battery is low: fly home") $
      timeout (timeLimit robot) (survey robot) `fallbackWith` \why ->
        logLine robot (displayException why ++ ": fly home")
    flyTo robot (home robot)

-- | Flies along the path and films. While the planner computes a new path, the drone goes on along
-- the present one; when the new path is ready, it changes to that.
survey :: Drone -> Behavior ()
survey robot = do
  path <- newTVarIO (firstPath robot)
  let planner = forever (nextPath robot >>= atomically . writeTVar path)
      paths = Signal.namedWith "path" (intercalate ", ") (Signal.watching (readTVar path))
      flight = Signal.switch paths (mapM_ (flyTo robot))
  film robot ||| planner ||| flight
