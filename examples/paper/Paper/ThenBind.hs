{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 5, inline: what sequencing without data stands for.
module Paper.ThenBind where

import Behavior.Paper
import Robot

bt = bhvr1 >>= \_ -> bhvr2

-- What the listing leaves undefined:
bhvr1 = open door
bhvr2 = passThrough door
