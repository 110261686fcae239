-- | What the robot should do: it brings a parcel to the front door, and is back at its dock before
-- the battery is empty.
module Mission (Robot (..), mission) where

import Control.Exception (finally)

import Behavior
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Trace (named)

-- | The hardware. @Main@ fills this record with drivers, the test with scripted actions.
data Robot = Robot
  { battery :: Signal Int
  -- ^ In percent.
  , driveTo :: String -> Behavior ()
  , stopWheels :: Behavior ()
  , handOver :: Behavior ()
  -- ^ Fails when no one opens the door.
  , putDown :: Behavior ()
  , charge :: Behavior ()
  }

mission :: Robot -> Behavior ()
mission robot = named "mission" (Signal.monitor batteryLow recharge deliver)
 where
  batteryLow = Signal.named "battery low" ((< 20) <$> Signal.named "battery" (battery robot))
  recharge = drive "dock" >> named "charge" (charge robot)
  deliver = drive "front door" >> (named "hand over" (handOver robot) ? named "put down" (putDown robot))
  drive place = named ("drive to the " ++ place) (driveTo robot place `finally` stopWheels robot)
