{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 3.1: a robot that passes through a door and closes it behind it, as nested
-- reactive selections.
--
-- The text is the paper's, except for the parentheses around the third argument of each
-- @rSelect@: without them it does not compile.
module Paper.PassDoor where

import Behavior.Paper
import Robot

passDoor = rSelect (insideRoom & doorClosed) doTask
            (rSelect insideRoom (close door)
             (rSelect doorClosed (open door) (passThrough door)))
