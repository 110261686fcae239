{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 4, inline: the result of one behaviour is the argument of the next.
module Paper.FindBox where

import Behavior.Paper
import Robot

bt = findBox >>= moveTo
