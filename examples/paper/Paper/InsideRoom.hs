{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 3.3: passing through the door is interrupted, or skipped, when the robot is in
-- the room.
module Paper.InsideRoom where

import Behavior.Paper
import Robot

bt = rSelect insideRoom (close door) (passThrough door)
