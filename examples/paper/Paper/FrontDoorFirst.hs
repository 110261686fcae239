{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 6, first version: with the most basic operations.
--
-- As printed it does not do what its text says: see the errata.
module Paper.FrontDoorFirst where

import Behavior.Paper
import Robot

bt = monitor batteryLow recharge
        (( (if (isOpen frontDoor) then (open frontDoor) else return ()
          >> passThrough frontDoor
          >> close frontDoor)
          ? ((open backDoor ? smash backDoor)
            >> passThrough backDoor))
        >> doTask)
