{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 6: a condition built from the result of another behaviour.
module Paper.BatteryLow where

import Behavior.Paper
import Robot hiding (batteryLow)

batteryLow = (<10) <$> batteryLevel
