{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 3.3, footnote: the same, shorter. The paper gives the expression.
module Paper.Unless where

import Behavior.Paper
import Robot

bt = do unless insideRoom (passThrough door); close door
