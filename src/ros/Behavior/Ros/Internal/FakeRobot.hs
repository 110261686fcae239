{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- A scripted robot: its work, and what a test does with it.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.FakeRobot
  ( -- * The robot
    FakeRobot
  , withFakeRobot

    -- * What a test does with it
  , publish
  , offerService
  , sendBytes
  , loseLink
  , restoreLink
  , freezeLink
  , workSerially

    -- * What it has seen
  , seen
  , runningGoals
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Monad (forever, unless)
import Data.Aeson (Value (Null))
import Data.ByteString.Lazy (ByteString)
import Data.Foldable (for_, traverse_)
import qualified Data.Map.Strict as Map
import qualified Data.Text as Text

import Behavior (Behavior, Seconds, sleep)
import Behavior.Internal.Concurrent.Service
import Behavior.Parallel (firstOf, fork, scoped)
import Behavior.Ros.Internal.FakeScript
import Behavior.Ros.Internal.FakeState
import Behavior.Ros.Internal.Frame
import Behavior.STM (atomically)
import Behavior.Time (now)

-- | Runs a behaviour beside a robot with these actions. (A goal runs on when the link is lost, and the robot is there
-- until the behaviour has ended, cleanup included.)
--
-- @since 0.1.0.0
withFakeRobot :: [(String, Value -> GoalScript)] -> (FakeRobot -> Behavior a) -> Behavior a
withFakeRobot actions behavior = do
  robot <-
    FakeRobot (Map.fromList [(Text.pack name, f) | (name, f) <- actions])
      <$> newTQueueIO
      <*> newTVarIO Map.empty
      <*> newTVarIO 0
      <*> newTVarIO Map.empty
      <*> newTQueueIO
      <*> newTVarIO []
      <*> newTVarIO True
      <*> newTVarIO False
      <*> newTVarIO False
      <*> newTVarIO Map.empty
      <*> newTVarIO []
  let works nursery = forever (atomically (newWork robot) >>= fork nursery)
  servedBy (scoped works) (behavior robot)

-- | What is to be done next.
newWork :: FakeRobot -> STM (Behavior ())
newWork robot = (workOn robot <$> readTQueue (newGoals robot)) `orElse` readTQueue (newCalls robot)

-- | Works on a goal.
workOn :: FakeRobot -> Goal -> Behavior ()
workOn robot it = do
  sleep (acceptedAfter plan)
  atomically $ unless refused (writeTVar (isAccepted it) True >> publishStatus robot (action it))
  how <- if refused then pure Refuses else firstOf [byItself, afterCancel, reporting]
  time <- now
  atomically $ do
    let (status, values) = result how
    modifyTVar' (goals robot) (Map.delete (number it))
    note robot time (GoalEnded (number it) status)
    -- (A bridge has no status for a goal that was not accepted.)
    answer (sender it) (Result (idThere it) (if refused then 6 else status) values)
    unless refused (publishStatus robot (action it))
 where
  plan = script it
  refused = case endsWith plan of
    Refuses -> True
    _ -> False
  byItself = endsWith plan <$ sleep (endsAfter plan)
  afterCancel = do
    atomically (readTVar (cancelWanted it) >>= check)
    confirmsWith plan <$ sleep (confirmsAfter plan)
  reporting = do
    for_ (feedbacks plan) $ \(pause, value) ->
      sleep pause >> atomically (answer (sender it) (Feedback (idThere it) value))
    forever (sleep (1 / 0))
  result = \case
    Succeeds values -> (4, values)
    Cancels -> (5, Null)
    Aborts why -> (6, why)
    Refuses -> (0, "the goal was not accepted")

-- | Publishes a message on a topic, whose last one a new subscriber receives.
--
-- @since 0.1.0.0
publish :: FakeRobot -> String -> Value -> Behavior ()
publish robot name = atomically . publishNow robot (Text.pack name)

-- | From now on there is a service with this name.
--
-- @since 0.1.0.0
offerService :: FakeRobot -> String -> (Value -> ServiceScript) -> Behavior ()
offerService robot name scriptFor = atomically (modifyTVar' (services robot) (Map.insert (Text.pack name) scriptFor))

-- | Sends these bytes as a frame, whatever they are.
--
-- @since 0.1.0.0
sendBytes :: FakeRobot -> ByteString -> Behavior ()
sendBytes robot bytes = atomically (readTVar (clients robot) >>= traverse_ (\it -> writeTQueue (toClient it) bytes))

-- | The bridge ends. What the robot does goes on.
--
-- @since 0.1.0.0
loseLink :: FakeRobot -> Behavior ()
loseLink robot = atomically $ do
  writeTVar (isReachable robot) False
  readTVar (clients robot) >>= traverse_ (\it -> writeTVar (isBroken it) True)
  writeTVar (clients robot) []

-- | The bridge is there again, and not frozen.
--
-- @since 0.1.0.0
restoreLink :: FakeRobot -> Behavior ()
restoreLink robot = atomically (writeTVar (isReachable robot) True >> writeTVar (isFrozen robot) False)

-- | The bridge neither answers nor ends: the link is half open. What is sent to it is lost.
--
-- @since 0.1.0.0
freezeLink :: FakeRobot -> Behavior ()
freezeLink robot = atomically (writeTVar (isFrozen robot) True)

-- | From now on the bridge works on a request only when no goal runs, as rosbridge_suite does with its fault 909: a
-- cancel comes when there is nothing to cancel any more.
--
-- @since 0.1.0.0
workSerially :: FakeRobot -> Behavior ()
workSerially robot = atomically (writeTVar (isSerial robot) True)

-- | What the robot has seen and done, in order, with the times.
--
-- @since 0.1.0.0
seen :: FakeRobot -> STM [(Seconds, Seen)]
seen robot = reverse <$> readTVar (record robot)

-- | The numbers of the goals that have not ended on the robot.
--
-- @since 0.1.0.0
runningGoals :: FakeRobot -> STM [Int]
runningGoals robot = Map.keys <$> readTVar (goals robot)
