{-# LANGUAGE LambdaCase #-}

-- |
-- The versions of the program: the paper's own listings, and one with names.
module Programs
  ( behavior
  ) where

import Behavior (Behavior)
import qualified Behavior.Signal as Signal
import Named (Robot (..))
import qualified Named
import Options (Program (..))
import qualified Paper.EachDoor as EachDoor
import qualified Paper.EachDoorThreeTimes as EachDoorThreeTimes
import qualified Paper.FrontDoorFirst as FrontDoorFirst
import qualified Paper.FrontDoorUnless as FrontDoorUnless
import qualified Paper.Introduction as Introduction
import qualified Robot as Mock
import World (Door)

behavior :: Program -> Behavior ()
behavior = \case
  First -> FrontDoorFirst.bt
  WithDo -> FrontDoorUnless.bt
  OverDoors -> EachDoor.bt
  WithAttempts -> EachDoorThreeTimes.bt
  Introduction -> Introduction.bt
  WithNames -> Named.bt mock

-- | The robot of the mock world.
mock :: Robot Door
mock =
  Robot
    { frontDoor = Mock.frontDoor
    , backDoor = Mock.backDoor
    , open = Mock.open
    , passThrough = Mock.passThrough
    , close = Mock.close
    , smash = Mock.smash
    , recharge = Mock.recharge
    , doTask = Mock.doTask
    , battery = Signal.polling 0.01 Mock.batteryLevel
    }
