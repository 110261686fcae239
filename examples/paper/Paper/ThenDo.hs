{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 5: sequencing without data, in do-notation. The paper gives the expression.
module Paper.ThenDo where

import Behavior.Paper
import Robot

bt =
    do bhvr1
       bhvr2

-- What the listing leaves undefined:
bhvr1 = open door
bhvr2 = passThrough door
