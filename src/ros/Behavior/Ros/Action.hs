-- |
-- Goals of a robot's actions: what takes time on the robot, as a behaviour.
--
-- > fallbackOver rooms (goal ros navigate . to)
--
-- 'goal' ends only when the goal has ended /on the robot/. So the promises of all operators hold for a robot at the
-- other end of a network: when a branch has been stopped, the robot stands still before the next one starts.
--
-- == When they do not hold
--
-- Two faults are, beside 'Behavior.Time.abandoning', the way out of the promises structured and never both. With
-- 'Behavior.Ros.NotConfirmed' and 'Behavior.Ros.LinkLost' the robot may still move when the operator goes on. Such a
-- goal is counted ('Behavior.Ros.movingGoals') until its server says that it has ended, and a new goal on that action
-- is refused with 'Behavior.Ros.StillMoving', unless it is 'replacing'. No program can stop a robot that it does not
-- reach: that is what a watchdog on the robot is for.
module Behavior.Ros.Action
  ( -- * Actions
    RosAction (..)
  , Action
  , action
  , untyped
  , replacing

    -- * Goals
  , goal
  , goalWith

    -- * In an emergency
  , stopAll
  ) where

import Behavior.Ros.Internal.Goal
import Behavior.Ros.Internal.StopAll
