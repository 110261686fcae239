{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 3.3: an interruption that is needed. Moving forward does not end by itself.
module Paper.Wall where

import Behavior.Paper
import Robot

bt = rSelect closeToWall turn moveForward
