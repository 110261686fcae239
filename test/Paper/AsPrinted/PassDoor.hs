{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w -fdefer-type-errors #-}

-- | Section 3.1, as printed: without parentheses it does not type.
module Paper.AsPrinted.PassDoor where

import Behavior.Paper
import Robot

passDoor = rSelect (insideRoom & doorClosed) doTask
            rSelect insideRoom (close door)
             rSelect doorClosed (open door) (passThrough door)
