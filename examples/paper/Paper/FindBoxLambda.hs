{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 4: what one behaviour returns is given a name.
module Paper.FindBoxLambda where

import Behavior.Paper
import Robot

bt = findBox >>= (\ box -> moveTo box)
