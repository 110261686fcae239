{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 5, inline: sequencing without data.
module Paper.Then where

import Behavior.Paper
import Robot

bt = bhvr1 >> bhvr2

-- What the listing leaves undefined:
bhvr1 = open door
bhvr2 = passThrough door
