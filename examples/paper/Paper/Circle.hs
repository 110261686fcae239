{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 3.2: drive in a circle, then go to a location: as a sequence, and with an
-- artificial condition that holds when the circle is done.
--
-- The paper prints both in the notation of Behavior Trees: @circle ->* goto location@ and
-- @(circleDone ? circle) -> goto location@.
module Paper.Circle where

import Behavior.Paper
import Robot

bt = circle >> goto location

artificial = rSelect circleDone (goto location) circle

-- What these leave undefined:
goto = moveTo
location = Box
circleDone = c1
