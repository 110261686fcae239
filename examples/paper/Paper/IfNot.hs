{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 3.3: skipping an action that is not needed, without interruptions.
module Paper.IfNot where

import Behavior.Paper
import Robot

bt = do if not insideRoom then passThrough door else return ();
        close door
