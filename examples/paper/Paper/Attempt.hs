{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 6: trying up to so many times. It never ends for a negative number, and it is not
-- the one that the fourth version calls: see the errata.
module Paper.Attempt where

import Behavior.Paper hiding (attempt)

attempt n task = if n == 0 then throw Failed else task ? attempt (n-1) task
