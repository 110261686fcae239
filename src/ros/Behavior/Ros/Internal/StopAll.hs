{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE TypeFamilies #-}

-- |
-- Stopping all goals of an action.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.StopAll
  ( stopAll
  , Cancelling (..)
  ) where

import Control.Exception (throwIO)
import Control.Monad (unless, when)
import Data.Aeson (Value, object, withObject, (.=))
import qualified Data.Text as Text

import Behavior (Behavior, (?))
import Behavior.Ros.Internal.Call
import Behavior.Ros.Internal.Error
import Behavior.Ros.Internal.Goal
import Behavior.Ros.Internal.Link
import Behavior.Ros.Internal.Message
import Behavior.Ros.Internal.Options
import Behavior.Ros.Internal.Status
import Behavior.Ros.Internal.Topic
import qualified Behavior.Signal as Signal
import Behavior.Time (timeout)
import Behavior.Trace (named)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Ros
-- >>> import Behavior.Ros.Action
-- >>> import Behavior.Ros.Fake
-- >>> import Behavior.Sim (simulate)
-- >>> import Behavior.Time (now)
-- >>> import Control.Monad (void)

-- | Cancels /all/ goals of the action's server, also those of other programs, and waits until the server says that they
-- have ended. No operator does this: it is for an emergency, or for goals that were left behind ('NotConfirmed',
-- 'LinkLost', or a program that has crashed).
--
-- [Result] Nothing runs that ran when it was called.
-- [Failure] 'ServiceFailed', if the server does not cancel them, or is not there; 'TooSlow', 'NoServer' as
--   'Behavior.Ros.call'.
-- [Fault] 'NotConfirmed', if the server does not say within 'Behavior.Ros.patience' that they have ended: the robot may
--   still move. 'LinkLost', 'Undecodable'.
-- [Cancellation] Returns at once; the goals are being cancelled all the same.
--
-- >>> let carry = untyped "/carry" "my_robot/action/Carry"
-- >>> let server _ = succeeding {endsAfter = 60, confirmsAfter = 0.5}
-- >>> :{
-- void . simulate . withFakeRobot [("/carry", server)] $ \robot -> withRos (fakeRos robot) $ \ros -> do
--   (sleep 10 >> stopAll ros carry) `both` (goal ros carry (toRos ()) ? pure (toRos ()))
--   now >>= print
-- :}
-- 10.5
--
-- @since 0.1.0.0
stopAll :: Ros -> Action a -> Behavior ()
stopAll ros which = named ("stop all goals: " ++ name) $ do
  -- (Subscribed to before the call: no change is missed.)
  _ <- subscribed ros statuses
  Cancelling how goals <- call ros (service (name ++ "/_action/cancel_goal") :: Service CancelGoal) ()
  when (how == rejected) $ throwIO (ServiceFailed name "it does not cancel them")
  unless (null goals) $
    timeout (patience (rosOptions ros)) (Signal.waitUntil (endOf goals <$> latest ros statuses))
      ? throwIO (NotConfirmed name "its server has not said that they have ended")
 where
  name = Text.unpack (nameIn ros which)
  statuses = topic (Text.unpack (statusOf (nameIn ros which))) latched :: Topic Statuses
  rejected = 1
  endOf goals (Statuses known) = and [maybe False hasEnded (lookup g known) | g <- goals]

-- | action_msgs/srv/CancelGoal. (An empty request is about all goals.)
data CancelGoal

instance RosService CancelGoal where
  type Question CancelGoal = ()
  type Answer CancelGoal = Cancelling
  serviceType _ = "action_msgs/srv/CancelGoal"

-- | The code of the answer, and the goals that are being cancelled.
data Cancelling = Cancelling Int [Value]

instance RosMessage Cancelling where
  fromRos = withObject "CancelGoal" $ \o ->
    Cancelling <$> entry o "return_code" <*> (entry o "goals_canceling" >>= traverse goalId)
  toRos (Cancelling how goals) =
    object ["return_code" .= how, "goals_canceling" .= [object ["goal_id" .= g] | g <- goals]]
