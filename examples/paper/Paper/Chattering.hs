{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 3.4: the first example again, because it chatters. The condition interrupts the
-- recharging too.
module Paper.Chattering where

import Behavior.Paper
import Robot

bt = rSelect (battery > 10) task recharge
