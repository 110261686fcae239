{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Introduction, Figure 1: the robot must enter a room to perform a task. It tries to
-- open each door three times before moving on to the next, and whenever the battery is
-- low meanwhile, it recharges.
module Paper.Introduction where

import Behavior.Paper
import Robot

openPassClose door = open door >> passThrough door >> close door
enterRoom = do doors <- findDoors
               fallback doors (attemptNTimes 3 openPassClose)
monitorBattery = monitor ((<10) <$> batteryLevel) recharge
bt = monitorBattery (enterRoom >> performTask)
