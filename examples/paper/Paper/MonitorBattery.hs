{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 3.4, inline: one-sided interruption. The condition interrupts the task, and
-- never the recharging. The paper gives the expression.
module Paper.MonitorBattery where

import Behavior.Paper
import Robot

bt = monitor batteryLow recharge task
