-- |
-- Two mock greenhouses for the rover, in which things happen at given times.
module GreenhouseWorld
  ( Setting (..)
  , calm
  , greenhouses
  ) where

import Beds
import Behavior
import qualified Behavior.Signal as Signal
import Behavior.Sim.Mock
import GreenhouseRover

-- | What changes at which times (in seconds), and what the devices do.
data Setting = Setting
  { battery :: [(Seconds, Double)]
  , emergency, someone, bumps :: [(Seconds, Bool)]
  , orders :: [(Seconds, Mode)]
  , radio :: [Script ()]
  , pictures :: Bed -> [Script String]
  , docks :: House -> [Script ()]
  , logged :: String -> Behavior ()
  }

-- | Nothing happens except what the rover does.
calm :: Setting
calm =
  Setting
    { battery = [(0, 100)]
    , emergency = [(0, False)]
    , someone = [(0, False)]
    , bumps = [(0, False)]
    , orders = [(0, Auto)]
    , radio = [succeeds]
    , pictures = \bed -> [returning ("picture of " ++ show bed) `taking` 0.25]
    , docks = const [succeeds `taking` 2]
    , logged = \_ -> pure ()
    }

greenhouses :: Setting -> IO (Mock, Rover)
greenhouses s = do
  world <- newMock
  place <- condition world "position" [(0, AtDock North)]
  motors <- condition world "motors" [(0, False)]
  arm <- condition world "arm out" [(0, False)]
  bump <- condition world "bump" (bumps s)
  stop <- condition world "emergency stop" (emergency s)
  near <- condition world "someone near" (someone s)
  level <- condition world "battery" (battery s)
  mode <- condition world "mode" (orders s)
  on <- action world "motors on" [succeeds `causing` set motors True]
  off <- action world "motors off" [succeeds `causing` set motors False]
  steer <- actionOn world "steer to" $ \to -> [succeeds `taking` 1 `causing` set place to `slowToStop` 1]
  back <- action world "back off" [succeeds `taking` 0.5 `causing` set bump False]
  stick <- action world "joystick" [hangs]
  out <- action world "arm: out" [succeeds `taking` 0.5]
  park <- action world "park arm" [succeeds `taking` 0.5 `causing` set arm False]
  photo <- actionOn world "camera" (pictures s)
  openIt <- action world "open door" [succeeds `taking` 0.5]
  closeIt <- action world "close door" [succeeds `taking` 0.5]
  plug <- actionOn world "charge" $ \house -> [how `causing` set level 95 | how <- docks s house]
  ask <- sensor world "radio" (radio s)
  pure
    ( world
    , Rover
        { motorsOn = on
        , motorsOff = off
        , steerTo = steer
        , backOff = back
        , joystick = stick
        , position = Signal.polling 0.25 (reading place)
        , bumper = signal bump
        , emergencyStop = signal stop
        , someoneNear = signal near
        , armOut = set arm True >> out
        , armPark = park
        , camera = photo
        , openDoor = openIt
        , closeDoor = closeIt
        , batteryLevel = reading level
        , plugIn = plug
        , askMode = ask >> reading mode
        , writeLog = logged s
        }
    )
