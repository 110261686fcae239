{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 4: the same in do-notation.
module Paper.FindBoxDo where

import Behavior.Paper
import Robot

bt = do box <- findBox
        moveTo box
