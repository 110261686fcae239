{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The bridge of a fake robot.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.FakeBridge
  ( fakeRos
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (finally)
import Control.Monad (filterM, unless, when)
import Data.ByteString.Lazy (ByteString)
import Data.Foldable (for_, traverse_)
import qualified Data.Map.Strict as Map
import qualified Data.Set as Set
import qualified Data.Text as Text

import Behavior (Behavior, Seconds, sleep)
import Behavior.Ros.Internal.FakeScript
import Behavior.Ros.Internal.FakeState
import Behavior.Ros.Internal.Frame
import Behavior.Ros.Internal.Message
import Behavior.Ros.Internal.Options (RosOptions (frameBytes, frameDepth), defaultRosOptions)
import Behavior.Ros.Internal.StopAll (Cancelling (..))
import Behavior.Ros.Internal.Transport
import Behavior.STM (atomically)
import Behavior.Time (now)

-- | The way to a fake robot.
--
-- @since 0.1.0.0
fakeRos :: FakeRobot -> Transport
fakeRos robot =
  Transport
    { address = "the fake robot"
    , refusal = Nothing
    , newSuffix = pure mempty
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
        modifyTVar' (clients robot) (it :)
        note robot time Connected
        pure (Just it)
  disconnect it = do
    writeTVar (isBroken it) True
    modifyTVar' (clients robot) (filter ((/= isBroken it) . isBroken))
  connection received it =
    Connection
      { receiveFrame = atomically (unlessBroken it (onceNotFrozen (readTQueue (toClient it))))
      , bytesCame = pure 0
      , sendFrame = \frame -> now >>= \time -> atomically (unlessBroken it (unlessFrozen (takeFrame it time frame)))
      , sendPing = atomically (unlessBroken it (readTVar (isFrozen robot))) >>= \frozen -> unless frozen received
      , sendClose = atomically (unlessBroken it (unlessFrozen (writeTVar (isBroken it) True)))
      }
  takeFrame it time frame = do
    later <- (&&) <$> readTVar (isSerial robot) <*> (not . Map.null <$> readTVar (goals robot))
    if later then writeTQueue (newCalls robot) (postponed it frame) else obey robot it time frame
  postponed it frame = do
    atomically (readTVar (goals robot) >>= check . Map.null)
    now >>= \time -> atomically (obey robot it time frame)
  unlessBroken it act =
    readTVar (isBroken it) >>= \broken ->
      if broken then throwSTM (userError "connection lost") else act
  onceNotFrozen act = readTVar (isFrozen robot) >>= check . not >> act
  unlessFrozen act = readTVar (isFrozen robot) >>= \frozen -> unless frozen act

-- | Does what a frame asks for.
obey :: FakeRobot -> Client -> Seconds -> ByteString -> STM ()
obey robot it time frame = case decodeRequest limits frame of
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
      note robot time (GoalCame count (Text.unpack name) wanted)
      writeTQueue (newGoals robot) new
      modifyTVar' (goals robot) (Map.insert count new)
  Right (Advertise name _ _) -> note robot time (Advertised (Text.unpack name))
  Right (Unadvertise name) -> note robot time (Unadvertised (Text.unpack name))
  Right (Publish name message) -> note robot time (Published (Text.unpack name) message)
  Right (CallService n name _ question) -> do
    note robot time (Called (Text.unpack name) question)
    case Text.stripSuffix "/_action/cancel_goal" name of
      Just actionName | Map.member actionName (scripts robot) -> do
        found <- filter ((== actionName) . action) . Map.elems <$> readTVar (goals robot)
        -- (Those that are being cancelled already are not among those that it can cancel.)
        can <- filterM (fmap not . readTVar . cancelWanted) found >>= filterM (cancel time)
        answer it (Response n True (toRos (Cancelling 0 (map (goalId . number) can))))
      _ ->
        readTVar (services robot) >>= \known -> case Map.lookup name known of
          Nothing -> answer it (Response n False "there is no such service")
          Just f -> writeTQueue (newCalls robot) (answerCall it n (f question))
  Right (CancelGoal n _) -> do
    -- (Another client's goal may have the same id.)
    found <- filter (\g -> idThere g == n && isBroken (sender g) == isBroken it) . Map.elems <$> readTVar (goals robot)
    for_ found $ \g -> do
      can <- cancel time g
      unless can $ answer it (Complaint (Just n) "there is no such goal")
 where
  limits = Limits (frameBytes defaultRosOptions) (frameDepth defaultRosOptions)
  -- Whether it has accepted the goal, and so can.
  cancel at g = do
    accepted <- readTVar (isAccepted g)
    note robot at (CancelCame (number g) accepted)
    when accepted (writeTVar (cancelWanted g) True >> publishStatus robot (action g))
    pure accepted

-- | Answers a call.
answerCall :: Client -> Id -> ServiceScript -> Behavior ()
answerCall it n plan = do
  sleep (answersAfter plan)
  atomically (answer it (either (Response n False) (Response n True) (answersWith plan)))
