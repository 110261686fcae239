{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 6: tries a task up to the given number of times. It never ends for a negative
-- number, and the fourth version calls another one: see the errata.
module Paper.Attempt where

import Behavior.Paper hiding (attempt)

attempt n task = if n == 0 then throw Failed else task ? attempt (n-1) task
