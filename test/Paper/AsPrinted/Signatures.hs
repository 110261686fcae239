{-# OPTIONS_GHC -w #-}

-- |
-- The signatures that the paper prints, of what this package and the mock world
-- give: that this module compiles is the test.
module Paper.AsPrinted.Signatures where

import Prelude (Bool)

import Behavior.Paper (Behavior)
import qualified Behavior.Paper as Paper
import Robot (Box, Door)
import qualified Robot

-- Section 4
findBox :: Behavior Box
moveTo :: Box -> Behavior ()
findBox = Robot.findBox
moveTo = Robot.moveTo

(>>=) :: Behavior a -> (a -> Behavior b) -> Behavior b
(>>=) = (Paper.>>=)

bind :: Behavior Box -> (Box -> Behavior ()) -> Behavior ()
bind = (>>=)

-- Section 5
parallel :: Behavior a -> Behavior b -> Behavior ()
(|||) = parallel
parallel = Paper.parallel

both :: Behavior a -> Behavior b -> Behavior ()
both = Paper.both

rSelect :: Behavior Bool -> Behavior a -> Behavior a -> Behavior a
rSelect = Paper.rSelect

monitor :: Behavior Bool -> Behavior () -> Behavior a -> Behavior a
monitor = Paper.monitor

fallback :: Behavior a -> Behavior a -> Behavior a
fallback = Paper.fallback

-- Section 6
batteryLow :: Behavior Bool
recharge :: Behavior ()
open :: Door -> Behavior ()
passThrough :: Door -> Behavior ()
close :: Door -> Behavior ()
smash :: Door -> Behavior ()
doTask :: Behavior ()
isOpen :: Door -> Behavior Bool
frontDoor :: Door
backDoor :: Door
batteryLow = Robot.batteryLow
recharge = Robot.recharge
open = Robot.open
passThrough = Robot.passThrough
close = Robot.close
smash = Robot.smash
doTask = Robot.doTask
isOpen = Robot.isOpen
frontDoor = Robot.frontDoor
backDoor = Robot.backDoor
