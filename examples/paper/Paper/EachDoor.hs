{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 6, third version: over all doors.
module Paper.EachDoor where

import Behavior.Paper
import Robot

openPassClose door = open door >> passThrough door >> close door
enterRoom = do doors <- findDoors
               fallback doors openPassClose
monitorBattery = monitor ((<10) <$> batteryLevel) recharge

bt = monitorBattery (enterRoom >> doTask)
