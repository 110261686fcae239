{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w -fdefer-type-errors #-}

-- | Section 6, fourth version, with @attempt@ as the paper defines it: it does not type.
module Paper.AsPrinted.ThreeTimes where

import Behavior.Paper hiding (attempt)
import Paper.Attempt
import Robot

openPassClose door = open door >> passThrough door >> close door
enterRoom = do doors <- findDoors
               fallback doors (attempt 3 openPassClose)
monitorBattery = monitor ((<10) <$> batteryLevel) recharge

bt = monitorBattery (enterRoom >> doTask)
