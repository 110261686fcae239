{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 4: the result of one behaviour gets a name.
module Paper.FindBoxLambda where

import Behavior.Paper
import Robot

bt = findBox >>= (\ box -> moveTo box)
