{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Topics as signals.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Topic
  ( -- * Topics
    Topic
  , topic
  , Silence
  , atLeastEvery
  , latched
  , upToBytes

    -- * What comes on them
  , latest
  , withMessages
  , subscribed
  , measured
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (SomeException, bracket_, throw, toException)
import Control.Monad (join, unless, void, when)
import Data.Aeson (Value)
import qualified Data.Map.Strict as Map
import Data.Maybe (isNothing)
import Data.Proxy (Proxy (..))
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Behavior, Seconds, tryAny)
import Behavior.Internal.Core.Seconds (period)
import Behavior.Internal.Reactive.Inbox (Inbox, deliver, withInbox)
import Behavior.Internal.Signal.Source
import Behavior.Parallel (firstOf)
import Behavior.Ros.Internal.Error
import Behavior.Ros.Internal.Link
import Behavior.Ros.Internal.Message
import Behavior.STM (atomically)
import Behavior.Signal (waitUntil)
import Behavior.Time (now, sleepForever, sleepUntil)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Message (receive)
-- >>> import Behavior.Ros
-- >>> import Behavior.Ros.Fake
-- >>> import Behavior.Ros.Messages
-- >>> import Behavior.Ros.Messages.Sensor
-- >>> import Behavior.STM (atomically)
-- >>> import Behavior.Sim (simulate)
-- >>> import qualified Behavior.Signal as Signal
-- >>> import Behavior.Time (now)
-- >>> import Control.Monad (replicateM_, void)
-- >>> import Data.Foldable (traverse_)
-- >>> import Data.Text (Text, pack)

-- | A robot's topic, and how long it may be silent.
--
-- @since 0.1.0.0
data Topic a = Topic
  { topicName :: Text
  , mayBeSilent :: Seconds
  , atMostBytes :: Int
  }

-- | How long a topic may be silent: 'atLeastEvery', or 'latched'.
--
-- @since 0.1.0.0
newtype Silence = Silence Seconds

-- | A message comes at least that often. If none has come for that time, the topic's signal faults with
-- 'Silent'. (It must be at least a microsecond; otherwise the signal faults with an
-- 'Control.Exception.ErrorCall' when it is watched.)
--
-- @since 0.1.0.0
atLeastEvery :: Seconds -> Silence
atLeastEvery = Silence

-- | The topic may be silent: its last message counts, however old it is.
--
-- @since 0.1.0.0
latched :: Silence
latched = Silence (1 / 0)

-- | The topic with that name, and its expected silence. Without that a robot
-- whose sensor has died would be one whose battery is full: so there is no default.
--
-- > battery = topic "/battery_state" (atLeastEvery 2) :: Topic BatteryState
--
-- @since 0.1.0.0
topic :: String -> Silence -> Topic a
topic name (Silence silence) = Topic (Text.pack name) silence 0

-- | The same topic, whose messages have at most that many bytes: for those that are larger than
-- 'Behavior.Ros.frameBytes' (images, maps). One that is larger still is refused, as if it had not come. (A frame of
-- more than 20,000,000 bytes ends the connection, unless 'Behavior.Ros.frameBytes' is more.)
--
-- > map = upToBytes 8000000 (topic "/map" latched)
--
-- @since 0.1.0.0
upToBytes :: Int -> Topic a -> Topic a
upToBytes bytes which = which {atMostBytes = bytes}

-- | The latest message of a topic.
--
-- While no message has come there is no value: the operator waits. It subscribes when it is first watched, and if no
-- message has come after half of the expected silence, once more.
--
-- [Failure] 'NoServer', if there is no link within 'Behavior.Ros.noServerAfter'.
-- [Fault] 'Silent' after the expected silence, also if no message ever came; 'LinkLost' at once when the link is
--   lost; 'Undecodable' while the last message is not what is expected (until one comes that is).
--
-- A message that is older than the expected silence when the operator begins does not count, nor one from before a
-- loss of the link. (Some publishers keep their last message for new subscribers: that one counts when it comes,
-- whatever its age.)
--
-- The topic stays subscribed to until 'Behavior.Ros.withRos' ends, and all signals of that name share the
-- subscription: for later operators the last value is there at once.
--
-- >>> :{
-- void . simulate . withFakeRobot [] $ \robot -> withRos (fakeRos robot) $ \ros -> do
--   let battery = topic "/battery_state" (atLeastEvery 2)
--       publishes p = sleep 1 >> publish robot "/battery_state" (toRos (BatteryState Nothing (Just p) False))
--   mapM_ publishes [0.2, 0.05] `both` Signal.waitUntil ((< 0.1) <$> measured percentage (latest ros battery))
--   now >>= print
-- :}
-- 2.0
--
-- @since 0.1.0.0
latest :: forall a. RosMessage a => Ros -> Topic a -> Signal a
latest ros which = Signal $ \_ -> do
  _ <- period ("latest " ++ Text.unpack name) silence
  known <- subscribed ros which
  judged <- newTVarIO Unjudged
  pure
    (fromView (viewing known judged))
      {workers = [Worker "silence" (const (watchSilence ros name silence known judged) <$ writeTVar judged Unjudged)]}
 where
  name = absolute ros (topicName which)
  silence = mayBeSilent which
  viewing known judged = do
    before <- losses <$> readTVar (link ros)
    pure . constantView $ do
      void (lostSince ros before)
      readTVar judged >>= \case
        Unjudged -> retry
        Lacking why -> throwSTM why
        From n ->
          readTVar (newest known) >>= \case
            Just arrival | arrivalNumber arrival >= n -> either undecodable pure (decoded (arrived arrival))
            _ -> retry
  undecodable = throwSTM . Undecodable (Text.unpack name)

-- | Runs a behaviour with an inbox in which each message of the topic arrives once.
--
-- > withMessages ros orders 10 $ \inbox -> onMessage inbox (\order -> pure () <$ carryOut order) patrol
--
-- When more wait than there is room for, the oldest is dropped, and counted ('Behavior.Message.dropped'). What comes
-- before the behaviour begins, and while there is no link, does not arrive (but for the last message of a publisher
-- that keeps it). Two of them at once receive each message both.
--
-- [Result, failure] The behaviour's; 'NoServer', if there is no link within 'Behavior.Ros.noServerAfter'.
-- [Fault] The behaviour's; 'LinkLost' at once when the link is lost, and 'Silent' after the topic's expected silence:
--   both stop the behaviour. A message that is not what is expected throws 'Undecodable' where it is used.
--   A capacity of less than 1 is refused with an 'Control.Exception.ErrorCall'.
-- [Cancellation] Passes through.
--
-- >>> let orders = topic "/orders" latched :: Topic (Std Text)
-- >>> let customer robot = traverse_ (publish robot "/orders" . toRos . Std) (map pack ["tea", "cake"])
-- >>> :{
-- void . simulate . withFakeRobot [] $ \robot -> withRos (fakeRos robot) $ \ros ->
--   withMessages ros orders 10 $ \inbox -> do
--     (sleep 1 >> customer robot) `both` replicateM_ 2 (atomically (receive inbox) >>= print)
-- :}
-- Std {unStd = "tea"}
-- Std {unStd = "cake"}
--
-- @since 0.1.0.0
withMessages :: RosMessage a => Ros -> Topic a -> Int -> (Inbox a -> Behavior b) -> Behavior b
withMessages ros which capacity behavior =
  withInbox capacity (\_ -> pure (pure ())) $ \inbox -> do
    known <- subscribed ros which
    n <- atomically (newNumber ros)
    -- (It is decoded where it is used: no user's code runs in a thread of the link.)
    let receiving = atomically (modifyTVar' (receivers known) (Map.insert n (deliver inbox . expected)))
        ended = atomically (modifyTVar' (receivers known) (Map.delete n))
    bracket_ receiving ended (firstOf [behavior inbox, waitUntil (False <$ latest ros untyped) >> sleepForever])
 where
  expected = either (throw . Undecodable (Text.unpack (topicName which))) id . decoded
  untyped = Topic (topicName which) (mayBeSilent which) (atMostBytes which) :: Topic Value

-- | The topic, subscribed to.
subscribed :: forall a. RosMessage a => Ros -> Topic a -> Behavior Kept
subscribed ros which = do
  (name, typeName) <- inFull (absolute ros (topicName which), messageType (Proxy :: Proxy a))
  time <- now
  atomically $ do
    known <- keptOf ros name typeName time
    known <$ wantBytes ros known (atMostBytes which)

-- | Which messages count.
data Judged
  = -- | It is not known yet.
    Unjudged
  | -- | There should be one, and there is none.
    Lacking SomeException
  | -- | Those from this number on.
    From !Int

-- | Watches how long the topic is silent.
watchSilence :: Ros -> Text -> Seconds -> Kept -> TVar Judged -> Behavior ()
watchSilence ros name silence known judged = do
  tryAny (awaitLink ros) >>= either (atomically . writeTVar judged . Lacking) pure
  -- (A signal that is shared may have a value later.)
  atomically (readTVar (link ros) >>= check . isUp)
  begun <- now
  join . atomically $ do
    n <- readTVar (arrivals known)
    readTVar (newest known) >>= \case
      Just arrival | arrivedAt arrival + silence >= begun -> follow (arrivedAt arrival) n <$ writeTVar judged (From n)
      _ -> follow begun n <$ writeTVar judged (From (n + 1))
 where
  -- (For a topic that may be silent there is nothing more to watch.)
  follow since n = unless (silence == 1 / 0) $ do
    sleepUntil (since + silence / 2)
    next n (askAgain >> judge since n)
  judge since n = do
    sleepUntil (since + silence)
    join . atomically $
      newer n >>= \case
        Just arrival -> pure (goOn arrival)
        Nothing -> do
          writeTVar judged (Lacking (toException (Silent (Text.unpack name) silence)))
          pure $ do
            arrival <- atomically $ do
              arrival <- newer n >>= maybe retry pure
              arrival <$ writeTVar judged (From (arrivalNumber arrival))
            goOn arrival
  next n instead = atomically (newer n) >>= maybe instead goOn
  goOn arrival = follow (arrivedAt arrival) (arrivalNumber arrival)
  newer n = (\found -> if (arrivalNumber <$> found) > Just n then found else Nothing) <$> readTVar (newest known)
  -- The bridge may have lost the subscription. (But if a message has come over this connection, it has not: and a
  -- publisher that keeps its last message for new subscribers would send that again, as if it were alive.)
  askAgain = do
    time <- now
    atomically $ do
      none <- isNothing <$> readTVar (newest known)
      up <- isUp <$> readTVar (link ros)
      -- (The watch of another operator may have asked just now.)
      asked <- readTVar (askedAt known)
      when (none && up && time - asked >= 0.4 * silence) $ do
        writeTVar (askedAt known) time
        subscribeAgain ros name (keptType known)

-- | The number in a message that may be null (which bridges write for NaN and infinity). While it is null, or NaN,
-- the signal faults with 'NotMeasured': it compares itself into neither true nor false.
--
-- > batteryLow = (< 0.1) \<$\> measured percentage (latest ros battery)
--
-- @since 0.1.0.0
measured :: (a -> Maybe Double) -> Signal a -> Signal Double
measured number signal = Signal $ \demand -> do
  source <- open signal everyValue {readingTimes = readingTimes demand}
  pure source {view = mapView (>>= taken . number) <$> view source}
 where
  taken found = case found of
    Just x | not (isNaN x) -> pure x
    _ -> throwSTM NotMeasured
