{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 3.1: reactive selections nest.
module Paper.NestedSelection where

import Behavior.Paper
import Robot

bt = rSelect c1 (rSelect c3 a5 a4) (rSelect c2 a2 a1)
