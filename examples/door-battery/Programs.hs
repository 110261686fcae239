{-# LANGUAGE LambdaCase #-}

-- |
-- The versions of the program: the paper's own listings, and one with names.
module Programs
  ( behavior
  ) where

import Behavior (Behavior)
import qualified Named
import Options (Program (..))
import qualified Paper.EachDoor as EachDoor
import qualified Paper.EachDoorThreeTimes as EachDoorThreeTimes
import qualified Paper.FrontDoorFirst as FrontDoorFirst
import qualified Paper.FrontDoorUnless as FrontDoorUnless
import qualified Paper.Introduction as Introduction

behavior :: Program -> Behavior ()
behavior = \case
  First -> FrontDoorFirst.bt
  WithDo -> FrontDoorUnless.bt
  OverDoors -> EachDoor.bt
  WithAttempts -> EachDoorThreeTimes.bt
  Introduction -> Introduction.bt
  WithNames -> Named.bt
