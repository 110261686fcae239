{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 5, inline: the second behaviour runs if the first fails.
module Paper.FallbackInfix where

import Behavior.Paper
import Robot

bt = bhvr1 ? bhvr2

-- What the listing leaves undefined:
bhvr1 = open door
bhvr2 = smash door
