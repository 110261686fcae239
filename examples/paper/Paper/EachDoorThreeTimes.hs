{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 6, fourth version: each door three times.
module Paper.EachDoorThreeTimes where

import Behavior.Paper
import Robot

openPassClose door = open door >> passThrough door >> close door
enterRoom = do doors <- findDoors
               fallback doors (attempt 3 openPassClose)
monitorBattery = monitor ((<10) <$> batteryLevel) recharge

bt = monitorBattery (enterRoom >> doTask)
