{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 5: what do-notation with data stands for. The paper gives the expression.
module Paper.BindLambda where

import Behavior.Paper
import Robot

bt =
    bhvr1 >>= (\ result -> bhvr2 result)

-- What the listing leaves undefined:
bhvr1 = findBox
bhvr2 = moveTo
