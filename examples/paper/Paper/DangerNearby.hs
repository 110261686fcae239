{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 4.1: a condition that fails is not the same as one that is false.
module Paper.DangerNearby where

import Behavior.Paper
import Robot

bt = monitor dangerNearby hide doTask
