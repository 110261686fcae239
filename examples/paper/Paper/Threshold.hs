{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 3.4: an earlier example again. The robot is stopped on the threshold.
module Paper.Threshold where

import Behavior.Paper
import Robot

bt = rSelect insideRoom (close door) (passThrough door)
