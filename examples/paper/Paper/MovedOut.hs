{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 3.4: the robot may move further inside before it succeeds, and it should come
-- back when it is moved outside.
--
-- As printed the condition is inverted: see the errata.
module Paper.MovedOut where

import Behavior.Paper
import Robot

bt = monitor insideRoom (passThrough door) (close door)
