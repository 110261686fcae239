{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 3.2: an interruption that is necessary. Whenever the battery is low the task
-- is interrupted.
module Paper.Battery where

import Behavior.Paper
import Robot

bt = rSelect (battery > 10) task recharge
