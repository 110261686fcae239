{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 3.2, inline: the sequence of two actions as a reactive selection, "not a very
-- useful translation". The paper gives the expression.
module Paper.SequenceAsSelection where

import Behavior.Paper
import Robot

bt = rSelect action1done action2 action1

-- What the expression leaves undefined:
action1 = a1
action2 = a2
action1done = c1
