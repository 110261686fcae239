{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 5: sequencing with data, in do-notation. The paper gives the expression.
module Paper.BindDo where

import Behavior.Paper
import Robot

bt =
    do result <- bhvr1
       bhvr2 result

-- What the listing leaves undefined:
bhvr1 = findBox
bhvr2 = moveTo
