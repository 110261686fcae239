{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 6, second version: with @unless@, @$@ and do-notation.
module Paper.FrontDoorUnless where

import Behavior.Paper
import Robot

bt = monitor batteryLow recharge $
        (do unless (isOpen frontDoor) (open frontDoor)
            passThrough frontDoor
            close frontDoor)
        ? (do (open backDoor ? smash backDoor)
              passThrough backDoor)
        >> doTask
