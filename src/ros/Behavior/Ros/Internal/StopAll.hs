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

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (throwIO)
import Control.Monad (unless, when)
import Data.Aeson (Value, object, withObject, (.=))
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust)
import Data.Set (Set)
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Behavior, Seconds, (?))
import Behavior.Ros.Internal.Call
import Behavior.Ros.Internal.Error
import Behavior.Ros.Internal.Frame (Id)
import Behavior.Ros.Internal.Goal
import Behavior.Ros.Internal.Link
import Behavior.Ros.Internal.Message
import Behavior.Ros.Internal.Options
import Behavior.Ros.Internal.Sent
import Behavior.Ros.Internal.Status
import Behavior.Ros.Internal.Topic
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Time (now, timeout)
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
-- 'LinkLost', or a program that has crashed). Of ours, those no longer count as such that may still run.
--
-- [Result] Nothing runs that ran when the server was asked, also what it does not cancel, or was cancelling before.
--   (A server says nothing of its goals until it has had one, also one that has crashed and is there again. So if it
--   cancels none, and says nothing, this takes 'Behavior.Ros.patience'.)
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
  known <- subscribed ros statuses
  left <- now >>= atomically . leftBehind ros (nameIn ros which)
  Cancelling how goals <- call ros (service (name ++ "/_action/cancel_goal") :: Service CancelGoal) ()
  when (how == rejected) $ throwIO (ServiceFailed name "it does not cancel them")
  before <- readTVarIO (arrivals known)
  timeout (patience (rosOptions ros)) (atomically (askAgain known) >> untilEnded goals (since before known)) ? do
    saidNothing <- (== before) <$> readTVarIO (arrivals known)
    unless (saidNothing && null goals) $ throwIO (NotConfirmed name "its server has not said that they have ended")
  atomically (modifyTVar' (sent ros) (`Map.withoutKeys` left))
 where
  name = Text.unpack (nameIn ros which)
  statuses = topic (Text.unpack (statusOf (nameIn ros which))) latched :: Topic Statuses
  rejected = 1
  -- What was said before the answer may be older than the answer, or from a server that has crashed and is there again.
  askAgain known = do
    isSaid <- isJust <$> readTVar (newest known)
    when isSaid $ subscribeAgain ros (statusOf (nameIn ros which)) (keptType known)
  since before known =
    (\said n -> if n > before then Just said else Nothing)
      <$> latest ros statuses <*> Signal.watching (readTVar (arrivals known))
  -- (A server names only those that it begins to cancel now. What else runs is in what it says of all goals.)
  untilEnded goals said = do
    Signal.waitUntil (isJust <$> said)
    running <- foldMap (\(Statuses known) -> [g | (g, status) <- known, not (hasEnded status)]) <$> Signal.read said
    -- (It has forgotten what it no longer names.)
    let isOver known g = maybe (g `elem` running) hasEnded (lookup g known)
        areOver (Statuses known) = all (isOver known) (goals ++ running)
    Signal.waitUntil (maybe False areOver <$> said)

-- | Our goals on that action that may still run although nothing waits for them, and that have come to their server, or
-- never will.
leftBehind :: Ros -> Text -> Seconds -> STM (Set Id)
leftBehind ros name time = do
  ours <- Map.filter ((== name) . sentTo) <$> readTVar (sent ros)
  Map.keysSet . Map.filter id <$> traverse isLeft ours
 where
  isLeft one = do
    how <- readTVar (end one)
    by <- readTVar (arrivedBy one)
    pure $ case how of
      Just Unconfirmed -> True
      Just Lost -> by <= time
      _ -> False

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
