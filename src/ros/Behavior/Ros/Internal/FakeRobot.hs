{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- A scripted robot with its bridge.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.FakeRobot
  ( -- * The robot
    FakeRobot
  , withFakeRobot
  , fakeRos

    -- * What a test does with it
  , publish
  , sendBytes
  , loseLink
  , restoreLink
  , freezeLink

    -- * What it has seen
  , seen
  , runningGoals
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (finally)
import Control.Monad (forever, unless, when)
import Data.Aeson (Value (Null), object, (.=))
import Data.ByteString.Lazy (ByteString)
import Data.Foldable (for_, traverse_)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Set (Set)
import qualified Data.Set as Set
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Behavior, Seconds, sleep)
import Behavior.Parallel (firstOf, fork, scoped)
import Behavior.Ros.Internal.FakeScript
import Behavior.Ros.Internal.Frame
import Behavior.Ros.Internal.Service
import Behavior.Ros.Internal.Transport
import Behavior.STM (atomically)
import Behavior.Time (now)

-- | A robot with a bridge that exists only in the program, for simulations ("Behavior.Sim") and tests.
--
-- @since 0.1.0.0
data FakeRobot = FakeRobot
  { scripts :: Map Text (Value -> GoalScript)
  , newGoals :: TQueue Goal
  , goals :: TVar (Map Int Goal)
  , goalCount :: TVar Int
  , client :: TVar (Maybe Client)
  , isReachable :: TVar Bool
  , isFrozen :: TVar Bool
  , lastPublished :: TVar (Map Text Value)
  , record :: TVar [(Seconds, Seen)]
  }

-- | What is connected to the bridge.
data Client = Client
  { toClient :: TQueue ByteString
  , isBroken :: TVar Bool
  , subscribed :: TVar (Set Text)
  }

-- | A goal that was sent to the robot.
data Goal = Goal
  { number :: Int
  , sender :: Client
  , idThere :: Id
  , action :: Text
  , script :: GoalScript
  , isAccepted :: TVar Bool
  , cancelWanted :: TVar Bool
  }

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
      <*> newTVarIO Nothing
      <*> newTVarIO True
      <*> newTVarIO False
      <*> newTVarIO Map.empty
      <*> newTVarIO []
  let works nursery = forever (atomically (readTQueue (newGoals robot)) >>= fork nursery . workOn robot)
  servedBy (scoped works) (behavior robot)

-- | The way to a fake robot.
--
-- @since 0.1.0.0
fakeRos :: FakeRobot -> Transport
fakeRos robot =
  Transport
    { address = "the fake robot"
    , refusal = Nothing
    , connecting = \_ received use -> do
        time <- now
        found <- atomically (connect time)
        case found of
          Nothing -> ioError (userError "connection refused")
          Just it -> use (connection received it) `finally` atomically (disconnect it)
    }
 where
  connect time = do
    reachable <- readTVar (isReachable robot)
    if not reachable
      then pure Nothing
      else do
        it <- Client <$> newTQueue <*> newTVar False <*> newTVar Set.empty
        writeTVar (client robot) (Just it)
        note robot time Connected
        pure (Just it)
  disconnect it = writeTVar (isBroken it) True
  connection received it =
    Connection
      { receiveFrame = atomically (unlessBroken it (unlessFrozen (readTQueue (toClient it))))
      , sendFrame = \frame -> now >>= \time -> atomically (unlessBroken it (unlessFrozen' (obey robot it time frame)))
      , sendPing = atomically (unlessBroken it (readTVar (isFrozen robot))) >>= \frozen -> unless frozen received
      }
  unlessBroken it act =
    readTVar (isBroken it) >>= \broken ->
      if broken then throwSTM (userError "connection lost") else act
  unlessFrozen act = readTVar (isFrozen robot) >>= check . not >> act
  unlessFrozen' act = readTVar (isFrozen robot) >>= \frozen -> unless frozen act

-- | Does what a frame asks for.
obey :: FakeRobot -> Client -> Seconds -> ByteString -> STM ()
obey robot it time frame = case decodeRequest (Limits 1048576 64) frame of
  Left why -> answer it (Complaint Nothing (Text.pack why))
  Right (Subscribe name _) -> do
    modifyTVar' (subscribed it) (Set.insert name)
    note robot time (Subscribed (Text.unpack name))
    readTVar (lastPublished robot) >>= traverse_ (answer it . Message name) . Map.lookup name
  Right (Unsubscribe name) -> modifyTVar' (subscribed it) (Set.delete name)
  Right (SendGoal n name _ wanted) -> case Map.lookup name (scripts robot) of
    Nothing -> answer it (Complaint (Just n) ("there is no action " <> name))
    Just f -> do
      count <- (+ 1) <$> readTVar (goalCount robot)
      writeTVar (goalCount robot) count
      new <- Goal count it n name (f wanted) <$> newTVar False <*> newTVar False
      note robot time (GoalCame count (Text.unpack name))
      writeTQueue (newGoals robot) new
      modifyTVar' (goals robot) (Map.insert count new)
  Right (CancelGoal n _) -> do
    found <- filter (\g -> idThere g == n) . Map.elems <$> readTVar (goals robot)
    for_ found $ \g -> do
      accepted <- readTVar (isAccepted g)
      note robot time (CancelCame (number g) accepted)
      if accepted
        then writeTVar (cancelWanted g) True
        else answer it (Complaint (Just n) "there is no such goal")

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
    answer (sender it) (Result (idThere it) status values)
    publishStatus robot (action it)
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

-- | Sends an answer, if the connection is still there.
answer :: Client -> Answer -> STM ()
answer it what = readTVar (isBroken it) >>= \broken -> unless broken (writeTQueue (toClient it) (encodeAnswer what))

note :: FakeRobot -> Seconds -> Seen -> STM ()
note robot time what = modifyTVar' (record robot) ((time, what) :)

-- | Publishes which goals of the action run, as servers do whenever that changes.
publishStatus :: FakeRobot -> Text -> STM ()
publishStatus robot name = do
  running <- length . filter ((== name) . action) . Map.elems <$> readTVar (goals robot)
  publishNow robot (name <> "/_action/status") $
    object ["status_list" .= replicate running (object ["status" .= (2 :: Int)])]

publishNow :: FakeRobot -> Text -> Value -> STM ()
publishNow robot name value = do
  modifyTVar' (lastPublished robot) (Map.insert name value)
  readTVar (client robot) >>= traverse_ (\it -> do
    wanted <- Set.member name <$> readTVar (subscribed it)
    when wanted (answer it (Message name value)))

-- | Publishes a message on a topic, whose last one a new subscriber receives.
--
-- @since 0.1.0.0
publish :: FakeRobot -> String -> Value -> Behavior ()
publish robot name = atomically . publishNow robot (Text.pack name)

-- | Sends these bytes as a frame, whatever they are.
--
-- @since 0.1.0.0
sendBytes :: FakeRobot -> ByteString -> Behavior ()
sendBytes robot bytes = atomically (readTVar (client robot) >>= traverse_ (\it -> writeTQueue (toClient it) bytes))

-- | The bridge ends. What the robot does goes on.
--
-- @since 0.1.0.0
loseLink :: FakeRobot -> Behavior ()
loseLink robot = atomically $ do
  writeTVar (isReachable robot) False
  readTVar (client robot) >>= traverse_ (\it -> writeTVar (isBroken it) True)
  writeTVar (client robot) Nothing

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
