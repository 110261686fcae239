-- |
-- The robot of the tutorial "Testing a robot".
module Rover
  ( Rover (..)
  , mission
  , untilButton
  , goHomeAtFirst
  , goHome
  ) where

import Control.Exception (bracket_, finally)

import Behavior
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal

-- | What the mission needs: in the field the hardware, in a test a mock.
data Rover = Rover
  { motorOn, motorOff :: Behavior ()
  , driveRound, driveHome :: Behavior ()
  , honk :: Behavior ()
  , charge :: Behavior ()
  , batteryLow, redButton :: Signal Bool
  }

-- | Patrols, and goes home when the battery is low, until the button is pressed.
mission :: (Rover -> Behavior ()) -> Rover -> Behavior ()
mission home rover =
  untilButton rover (Signal.monitor (batteryLow rover) (home rover) (patrol rover))

untilButton :: Rover -> Behavior () -> Behavior ()
untilButton rover act = Signal.waitUntil (redButton rover) ||| act

patrol :: Rover -> Behavior ()
patrol rover = bracket_ (motorOn rover) (motorOff rover) (driveRound rover)

-- | The first version.
goHomeAtFirst :: Rover -> Behavior ()
goHomeAtFirst rover = do
  motorOn rover
  honk rover
  driveHome rover `finally` motorOff rover
  charge rover

-- | The corrected version.
goHome :: Rover -> Behavior ()
goHome rover = do
  bracket_ (motorOn rover) (motorOff rover) (honk rover >> driveHome rover)
  charge rover
