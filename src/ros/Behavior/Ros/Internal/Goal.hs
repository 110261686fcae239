{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE FlexibleContexts #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE ScopedTypeVariables #-}
{-# LANGUAGE TypeFamilies #-}

-- |
-- Goals of a robot's actions.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Goal
  ( -- * Actions
    RosAction (..)
  , Action
  , action
  , untyped
  , replacing
  , nameIn

    -- * Goals
  , goal
  , goalWith
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (catch, mask, throwIO, try)
import Control.Monad (unless, void, when)
import Data.Aeson (Value (Null, String))
import qualified Data.Map.Strict as Map
import Data.Proxy (Proxy (..))
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Behavior, StoppedWithFault (..), (?))
import Behavior.Internal.Spans.Observer (noticed)
import Behavior.Parallel (firstOf)
import Behavior.Ros.Internal.Error
import Behavior.Ros.Internal.Frame (Request (..))
import Behavior.Ros.Internal.Link
import Behavior.Ros.Internal.Message
import Behavior.Ros.Internal.Options
import Behavior.Ros.Internal.Sent
import Behavior.Ros.Internal.Status
import Behavior.STM (atomically)
import Behavior.Signal (Signal, watching)
import Behavior.Time (cleanupWithin, now, sleepForever, timeout)
import Behavior.Trace (Change (..), named)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Ros
-- >>> import Behavior.Ros.Action
-- >>> import Behavior.Ros.Fake
-- >>> import Behavior.Sim (simulate)
-- >>> import Behavior.Time (now, timeout)
-- >>> import Control.Monad (void)

-- | A type of actions.
--
-- > data Fibonacci
-- >
-- > instance RosAction Fibonacci where
-- >   type Goal Fibonacci = Order
-- >   type Result Fibonacci = Sequence
-- >   type Feedback Fibonacci = Sequence
-- >   actionType _ = "test_msgs/action/Fibonacci"
--
-- @since 0.1.0.0
class (RosMessage (Goal a), RosMessage (Result a), RosMessage (Feedback a)) => RosAction a where
  -- | What is to be done.
  type Goal a

  -- | What is known in the end.
  type Result a

  -- | What is known meanwhile.
  type Feedback a

  -- | The type's name.
  actionType :: Proxy a -> Text

-- | An action without a type of its own: see 'untyped'.
instance RosAction Value where
  type Goal Value = Value
  type Result Value = Value
  type Feedback Value = Value
  actionType _ = ""

-- | An action of a robot: a server that works on goals.
--
-- @since 0.1.0.0
data Action a = Action
  { nameOf :: Text
  , typeOf :: Text
  , preempts :: Bool
  }

-- | The action with that name.
--
-- > navigate = action "/navigate" :: Action PlanAndRun
--
-- @since 0.1.0.0
action :: forall a. RosAction a => String -> Action a
action name = Action (Text.pack name) (actionType (Proxy :: Proxy a)) False

-- | The action with that name and type, whose goals, results and feedback are JSON.
--
-- > count = untyped "/fibonacci" "test_msgs/action/Fibonacci"
--
-- @since 0.1.0.0
untyped :: String -> String -> Action Value
untyped name typeName = Action (Text.pack name) (Text.pack typeName) False

-- | The same action, of whose server you know that a new goal replaces the one before (Nav2's is so), or that it can
-- work on several: a goal of ours that may still run is no reason to refuse a new one.
--
-- @since 0.1.0.0
replacing :: Action a -> Action a
replacing which = which {preempts = True}

-- | Sends a goal, and waits for its result.
--
-- Interrupted, it ends only when the robot has confirmed that the goal has stopped: it asks the server to cancel
-- this goal, and asks again (five times after 20 ms each, then after 40, 80, 160 and every 200 ms), since servers drop
-- a cancel that comes before they have accepted the goal.
--
-- [Result] The goal's.
-- [Failure] 'Rejected', 'Aborted', 'CancelledByOther'; 'NoServer' if there is no link within
--   'Behavior.Ros.noServerAfter'; 'StillMoving' if a goal of ours on this action may still run, unless it is
--   'replacing'. (If the server is not there, nothing says so, and it waits. Interrupted, it ends with 'NotConfirmed'.
--   So wait for the server before: where there is none, 'Behavior.Ros.Action.stopAll' fails.)
-- [Fault] 'LinkLost' at once when the link is lost; 'Undecodable' if the result is not what is expected;
--   'NotConfirmed' if the server has not confirmed the stop within 'Behavior.Ros.patience'.
-- [Cancellation] Returns after the robot has confirmed; or with 'Behavior.StoppedWithFault', if there was 'LinkLost' or
--   'NotConfirmed'. (The operator that stopped it throws that fault.) A goal that succeeds all the same counts as
--   interrupted.
--
-- With 'NotConfirmed' and 'LinkLost' /the robot may still move/ when the operator goes on: so a
-- 'Behavior.Signal.monitor' may start its recovery while it does. Such goals are counted ('Behavior.Ros.movingGoals')
-- until the server says that they have ended: by the goal's result; to 'Behavior.Ros.Action.stopAll'; or, after a new
-- connection, that it has no goal left, and that not before 'Behavior.Ros.patience' (it may not have accepted the goal
-- yet). Until then a new goal on that action is refused with 'StillMoving'.
--
-- >>> let carry = untyped "/carry" "my_robot/action/Carry"
-- >>> let server _ = succeeding {endsAfter = 60, confirmsAfter = 0.5}
-- >>> :{
-- void . simulate . withFakeRobot [("/carry", server)] $ \robot -> withRos (fakeRos robot) $ \ros -> do
--   timeout 10 (() <$ goal ros carry (toRos ())) ? pure ()
--   now >>= print
-- :}
-- 10.5
--
-- @since 0.1.0.0
goal :: RosAction a => Ros -> Action a -> Goal a -> Behavior (Result a)
goal ros which wanted = newTVarIO Nothing >>= sendGoal ros (resolved ros which) wanted

-- | 'goal' with a behaviour beside it, which is given the goal's feedback. If that behaviour fails or faults, the
-- goal is stopped, and that is thrown; if it returns, the goal goes on.
--
-- > goalWith ros navigate kitchen (\feedback -> Signal.waitUntil ((< 1) . distance \<$\> feedback) >> openGripper)
--
-- There is no feedback at first; the behaviour waits for it. Feedback that is not what is expected is the fault
-- 'Undecodable'. Everything else is as in 'goal'.
--
-- @since 0.1.0.0
goalWith :: RosAction a => Ros -> Action a -> Goal a -> (Signal (Feedback a) -> Behavior ()) -> Behavior (Result a)
goalWith ros which wanted beside = do
  latest <- newTVarIO Nothing
  firstOf
    [ sendGoal ros there wanted latest
    , beside (watching (readTVar latest >>= maybe retry (expected there))) >> sleepForever
    ]
 where
  there = resolved ros which

-- | The action with its whole name.
resolved :: Ros -> Action a -> Action a
resolved ros which = which {nameOf = nameIn ros which}

-- | The whole name of the action.
nameIn :: Ros -> Action a -> Text
nameIn ros = absolute ros . nameOf

-- | What came from this action.
expected :: RosMessage b => Action a -> Value -> STM b
expected which = either (throwSTM . Undecodable (Text.unpack (nameOf which))) pure . decoded

sendGoal :: RosAction a => Ros -> Action a -> Goal a -> TVar (Maybe Value) -> Behavior (Result a)
sendGoal ros which wanted latest = named ("goal: " ++ name) $ do
  (_, _, message) <- inFull (nameOf which, typeOf which, toRos wanted)
  mask $ \restore -> do
    -- (It is registered and handed over in one transaction: no interruption comes between.)
    (n, running) <- handOver ros restore (start ros which message latest)
    noticed "goal" [Change "id" Nothing (Text.unpack n)]
    try (restore (atomically (awaitEnd running))) >>= \case
      -- (An interruption ends also a user's decoder that does not end.)
      Right (Ended 4 values) -> restore (expectedFrom name values)
      Right how -> atomically (conclude how)
      Left stop -> confirmation ros which n running >>= afterStop stop
 where
  name = Text.unpack (nameOf which)
  conclude how = case how of
    Ended 5 _ -> throwSTM (CancelledByOther name)
    -- (An action's result is an object. Text is the bridge's, when the goal was not accepted.)
    Ended 6 (String why) -> throwSTM (Rejected name (Text.unpack why))
    Ended 6 values -> throwSTM (Aborted name (textOf values))
    Ended _ values -> throwSTM (Rejected name (textOf values))
    Complained why -> throwSTM (Rejected name (Text.unpack why))
    Lost -> readTVar (link ros) >>= throwSTM . LinkLost (robot ros) . whyLost
    Unconfirmed -> whyNotConfirmed ros which >>= throwSTM . NotConfirmed name
  -- (Also if it has succeeded: if the stop ended here, what comes after the goal would run.)
  afterStop stop how
    | mayStillRun how = atomically (conclude how) `catch` (throwIO . StoppedWithFault stop)
    | otherwise = throwIO stop

-- | What is known of a server that does not confirm.
whyNotConfirmed :: Ros -> Action a -> STM String
whyNotConfirmed ros which = do
  known <- Map.lookup (statusOf (nameOf which)) <$> readTVar (kept ros)
  said <- maybe (pure Nothing) (readTVar . newest) known
  pure $ case decoded . arrived <$> said of
    Just (Right (Statuses goals))
      | 3 `elem` map snd goals -> "its server says that a goal is being cancelled"
      | all (hasEnded . snd) goals -> "its server says that none of its goals runs"
      | otherwise ->
          "its server says that a goal runs, and is not being cancelled: it has refused the cancel, or the bridge has"
            ++ " not passed it on (" ++ fault909 ++ ")"
    Just (Left why) -> why
    Nothing ->
      "nothing is known of its server: it is not there, or the bridge has not answered since (" ++ fault909 ++ ")"
 where
  fault909 = "bridges with the fault 909 of rosbridge_suite work on a cancel only when the goal has ended"

-- | Registers the goal, and hands it to the writer.
start :: Ros -> Action a -> Value -> TVar (Maybe Value) -> STM (Text, Sent)
start ros which wanted latest = do
  before <- mayRun ros (nameOf which)
  when (before && not (preempts which)) $ throwSTM (StillMoving (Text.unpack (nameOf which)))
  name <- newId ros "goal"
  connection <- connections <$> readTVar (link ros)
  running <- newSent (nameOf which) connection latest
  ask ros (SendGoal name (nameOf which) (typeOf which) wanted)
  modifyTVar' (sent ros) (Map.insert name running)
  pure (name, running)

-- | Cancels the goal, again and again, until it has ended or the patience has. One that was not sent yet is withdrawn.
confirmation :: Ros -> Action a -> Text -> Sent -> Behavior SentEnd
confirmation ros which n running = do
  begun <- now
  _ <- cleanupWithin limit (askEvery begun (replicate 5 0.02 ++ [0.04, 0.08, 0.16] ++ repeat 0.2))
  atomically (leave ros n running Unconfirmed >> awaitEnd running)
 where
  limit = patience (rosOptions ros)
  askEvery begun pauses = do
    time <- now
    let isLate = time - begun >= limit / 2
        asking = askToCancel >> when isLate (askForStatus time)
    ended <- atomically ((Just <$> awaitEnd running) `orElse` (Nothing <$ asking))
    case (ended, pauses) of
      (Nothing, pause : later) -> timeout pause (atomically (awaitEnd running)) ? askEvery begun later
      _ -> maybe (atomically (awaitEnd running)) pure ended
  askToCancel = do
    isOut <- readTVar (isSent running)
    if isOut then ask ros (CancelGoal n (nameOf which)) else withdraw
    before <- readTVar (cancelled running)
    unless before (writeTVar (cancelled running) True)
  withdraw = (running `endWith` Ended 5 Null) >> modifyTVar' (sent ros) (Map.delete n)
  askForStatus = void . keptOf ros (statusOf (nameOf which)) (messageType (Proxy :: Proxy Statuses))

awaitEnd :: Sent -> STM SentEnd
awaitEnd running = readTVar (end running) >>= maybe retry pure
