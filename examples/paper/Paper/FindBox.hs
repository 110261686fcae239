{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 4, inline: what one behaviour returns is handed to the next.
module Paper.FindBox where

import Behavior.Paper
import Robot

bt = findBox >>= moveTo
