{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 5, inline: sequencing with data.
module Paper.Bind where

import Behavior.Paper
import Robot

bt = bhvr1 >>= bhvr2

-- What the listing leaves undefined:
bhvr1 = findBox
bhvr2 = moveTo
