{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE RankNTypes #-}

-- |
-- What is known of a link: whether it is up, what was sent over it, and what came. (How that changes when it comes up
-- or goes down is in "Behavior.Ros.Internal.UpDown"; the threads that use it are in "Behavior.Ros.Internal.Keeper".)
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Link
  ( -- * The link
    Ros (..)
  , newRos
  , Link (..)
  , lostSince
  , linkUp
  , refusedFrames

    -- * Asking the bridge
  , awaitLink
  , handOver
  , ask
  , Advertised (..)

    -- * Names and numbers
  , inNamespace
  , absolute
  , newNumber
  , newId

    -- * What came
  , Kept (..)
  , Arrival (..)
  , keptOf
  , subscribeAgain
  , wantBytes
  , Reply (..)
  , mayRun
  , movingGoals
  , leave
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Monad (unless, when)
import Data.Aeson (Value)
import Data.Foldable (traverse_)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (isNothing)
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Behavior, Seconds, (?))
import Behavior.Ros.Internal.Error
import Behavior.Ros.Internal.Frame
import Behavior.Ros.Internal.Options
import Behavior.Ros.Internal.Sent
import Behavior.STM (atomically)
import Behavior.Signal (Signal, named, watching)
import Behavior.Time (timeout)

-- | A link to a robot.
--
-- @since 0.1.0.0
data Ros = Ros
  { robot :: String
  -- ^ Its address.
  , rosOptions :: RosOptions
  , suffix :: Text
  -- ^ What the names of its goals and calls end with.
  , link :: TVar Link
  , outgoing :: TBQueue Request
  -- ^ Empty while the link is down. (So the writer's thread alone writes, and no interruption tears a frame.)
  , cancels :: TBQueue Request
  -- ^ The same, for cancels: they go before everything else that waits.
  , pingWanted :: TVar Bool
  , received :: TVar Int
  -- ^ How often anything was received.
  , isReading :: TVar Bool
  -- ^ Whether a frame is being read: one of some megabytes takes seconds.
  , nextNumber :: TVar Int
  -- ^ Of goals, calls and receivers.
  , kept :: TVar (Map Text Kept)
  -- ^ The topics that were subscribed to, for as long as the link is used.
  , sent :: TVar (Map Id Sent)
  -- ^ The goals that may still run.
  , newlyLeft :: TQueue (Id, Text)
  -- ^ Those of them that nothing waits for any more, with their actions, until a trace shows them.
  , calls :: TVar (Map Id (TVar (Maybe Reply)))
  -- ^ The calls that wait for their answer.
  , advertised :: TVar (Map Text Advertised)
  -- ^ The topics on which the program publishes.
  , namespace :: Text
  -- ^ Of relative names.
  , largestFrame :: TVar Int
  -- ^ How many bytes a frame has at most, whatever it is.
  , refused :: TVar Int
  , reports :: TBQueue String
  , leftOut :: TVar Int
  -- ^ How many reports were left out since the last of these.
  }

-- | Whether the link is up, and its past.
data Link = Link
  { isUp :: !Bool
  , connections :: !Int
  -- ^ How often it has come up.
  , losses :: !Int
  , whyLost :: String
  , whyDown :: String
  -- ^ Why it was lost, or why the latest attempt to connect has failed.
  , isClosing :: !Bool
  -- ^ Whether its behaviour has ended, and the connection is to be closed.
  , isClosed :: !Bool
  }

-- | A topic.
data Kept = Kept
  { newest :: TVar (Maybe Arrival)
  , arrivals :: TVar Int
  , askedAt :: TVar Seconds
  -- ^ When it was last subscribed to.
  , keptType :: Text
  , receivers :: TVar (Map Int (Value -> STM ()))
  -- ^ What else takes each message.
  , bytesWanted :: TVar Int
  -- ^ How many bytes a message of this topic has at most.
  }

-- | A topic on which the program publishes: its type, whether the bridge keeps the last message, and how many
-- publishers there are.
data Advertised = Advertised !Text !Bool !Int

-- | A message that came: its number, and when that was.
data Arrival = Arrival
  { arrivalNumber :: !Int
  , arrivedAt :: !Seconds
  , arrived :: Value
  }

-- | What a service has answered.
data Reply
  = Answered Value
  | Refused Value
  | NoReply

-- | A link that is down.
newRos :: String -> Text -> RosOptions -> IO Ros
newRos name ending options =
  Ros name options ending
    <$> newTVarIO (Link False 0 0 "" "it has not connected yet" False False)
    <*> newTBQueueIO 256 <*> newTBQueueIO 256
    <*> newTVarIO False <*> newTVarIO 0 <*> newTVarIO False
    <*> newTVarIO 1
    <*> newTVarIO Map.empty <*> newTVarIO Map.empty <*> newTQueueIO <*> newTVarIO Map.empty <*> newTVarIO Map.empty
    <*> pure ""
    <*> newTVarIO (frameBytes options)
    <*> newTVarIO 0
    <*> newTBQueueIO 64 <*> newTVarIO 0

-- | The link, for names of a robot: a topic, action, service or node whose name does not begin with a slash is in this
-- namespace.
--
-- > driveTo room = goal (inNamespace "/robot1" ros) navigate (to room)     -- navigate = action "navigate"
--
-- Namespaces nest: one without a slash at its beginning is in that of the link. What is used through both is the
-- same: one connection, one subscription to each topic.
--
-- @since 0.1.0.0
inNamespace :: String -> Ros -> Ros
inNamespace name ros = ros {namespace = absolute ros (Text.pack name)}

-- | The name with its namespace.
absolute :: Ros -> Text -> Text
absolute ros name
  | "/" `Text.isPrefixOf` name = name
  | otherwise = Text.dropWhileEnd (== '/') (namespace ros) <> "/" <> name

-- | Whether there is a link. It never fails.
--
-- @since 0.1.0.0
linkUp :: Ros -> Signal Bool
linkUp ros = named "link up" (watching (isUp <$> readTVar (link ros)))

-- | How many frames were refused: too large, too deep, no JSON, none of rosbridge, or an answer that nothing awaits
-- (also one that comes too late).
--
-- @since 0.1.0.0
refusedFrames :: Ros -> Signal Int
refusedFrames = named "refused frames" . watching . readTVar . refused

-- | How many of our goals may still run: those that are awaited, and those of which it is not known whether they
-- have stopped ('NotConfirmed', 'LinkLost').
--
-- @since 0.1.0.0
movingGoals :: Ros -> Signal Int
movingGoals ros = named "moving goals" (watching (Map.size <$> readTVar (sent ros)))

-- | Throws if the link was lost more often than that, or is no longer used; and gives whether it is up.
lostSince :: Ros -> Int -> STM Bool
lostSince ros before = do
  l <- readTVar (link ros)
  when (losses l > before || isClosed l) $
    throwSTM (LinkLost (robot ros) (if isClosed l then "its withRos has ended" else whyLost l))
  pure (isUp l)

-- | Waits for a link, and fails after a limit.
awaitLink :: Ros -> Behavior ()
awaitLink ros = do
  -- (Most often it is up, and then no thread is started.)
  up <- atomically isThere
  unless up $ timeout (noServerAfter (rosOptions ros)) (atomically (isThere >>= check)) ? atomically noServer
 where
  isThere = do
    l <- readTVar (link ros)
    when (isClosed l) $ throwSTM (LinkLost (robot ros) "its withRos has ended")
    pure (isUp l)
  noServer = readTVar (link ros) >>= throwSTM . NoServer (robot ros) . whyDown

-- | Waits for a link, as 'awaitLink', and runs a transaction that asks the bridge. (Nothing is handed over later than
-- that: when the link is lost before, it waits again.) To be called masked; so no interruption comes after the
-- transaction.
handOver :: Ros -> (forall b. Behavior b -> Behavior b) -> STM a -> Behavior a
handOver ros restore asking = do
  restore (awaitLink ros)
  let whenDown = readTVar (link ros) >>= check . not . isUp
  atomically ((Just <$> asking) `orElse` (Nothing <$ whenDown)) >>= maybe (handOver ros restore asking) pure

-- | Asks the bridge. Retries while too much waits to be sent, and while the link is down.
ask :: Ros -> Request -> STM ()
ask ros request = do
  readTVar (link ros) >>= check . isUp
  (`writeTBQueue` request) $ case request of
    CancelGoal _ _ -> cancels ros
    _ -> outgoing ros

-- | A number that no other goal, call or receiver has.
newNumber :: Ros -> STM Int
newNumber ros = readTVar (nextNumber ros) >>= \n -> n <$ (writeTVar (nextNumber ros) $! n + 1)

-- | A name that no other goal or call has.
newId :: Ros -> Text -> STM Id
newId ros what = (\n -> what <> " " <> Text.pack (show n) <> suffix ros) <$> newNumber ros

-- | The topic with this name, subscribed to.
keptOf :: Ros -> Text -> Text -> Seconds -> STM Kept
keptOf ros name typeName time =
  readTVar (kept ros) >>= \topics -> case Map.lookup name topics of
    Just topic -> pure topic
    Nothing -> do
      topic <-
        Kept <$> newTVar Nothing <*> newTVar 0 <*> newTVar time <*> pure typeName <*> newTVar Map.empty <*> newTVar 0
      writeTVar (kept ros) (Map.insert name topic topics)
      l <- readTVar (link ros)
      when (isUp l) (ask ros (Subscribe name typeName))
      pure topic

-- | Subscribes again to the topic with this name and type: what its publisher keeps for new subscribers comes again.
subscribeAgain :: Ros -> Text -> Text -> STM ()
subscribeAgain ros name typeName = traverse_ (ask ros) [Unsubscribe name, Subscribe name typeName]

-- | Messages of the topic may have the given number of bytes, from now on.
wantBytes :: Ros -> Kept -> Int -> STM ()
wantBytes ros known bytes = do
  modifyTVar' (bytesWanted known) (max bytes)
  modifyTVar' (largestFrame ros) (max bytes)

-- | Whether a goal of ours may still run on this action.
mayRun :: Ros -> Text -> STM Bool
mayRun ros action = any ((== action) . sentTo) <$> readTVar (sent ros)

-- | Ends the goal, unless it has ended: it may still run, but nothing waits for it any more.
leave :: Ros -> Id -> Sent -> SentEnd -> STM ()
leave ros n known how = do
  before <- readTVar (end known)
  when (isNothing before) $ do
    known `endWith` how
    writeTQueue (newlyLeft ros) (n, sentTo known)
