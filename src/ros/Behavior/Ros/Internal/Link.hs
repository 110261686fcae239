{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- What is known of a link: whether it is up, what was sent over it, and what came. (The threads that use it are in
-- "Behavior.Ros.Internal.Keeper".)
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

    -- * Up and down
  , comeUp
  , goDown
  , awaitLink
  , ask

    -- * What came
  , Kept (..)
  , Arrival (..)
  , keptOf
  , Sent (..)
  , End (..)
  , mayRun
  , movingGoals
  , take
  , refuse
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Monad (unless, void, when)
import Data.Aeson (Object, Value, withObject, (.:))
import Data.Aeson.Types (parseEither)
import Data.Foldable (for_, traverse_)
import Data.List (nub)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (isNothing)
import Data.Text (Text)
import qualified Data.Text as Text
import Prelude hiding (take)

import Behavior (Behavior, Seconds, (?))
import Behavior.Ros.Internal.Error
import Behavior.Ros.Internal.Frame
import Behavior.Ros.Internal.Options
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
  , link :: TVar Link
  , outgoing :: TBQueue Request
  -- ^ Empty while the link is down. (So the writer's thread alone writes, and no interruption tears a frame.)
  , pingWanted :: TVar Bool
  , received :: TVar Int
  -- ^ How often anything was received.
  , nextGoal :: TVar Int
  , kept :: TVar (Map Text Kept)
  -- ^ The topics that were subscribed to, for as long as the link is used.
  , sent :: TVar (Map Id Sent)
  -- ^ The goals that may still run.
  , refused :: TVar Int
  , reports :: TBQueue String
  }

-- | Whether the link is up, and its past.
data Link = Link
  { isUp :: !Bool
  , connections :: !Int
  -- ^ How often it has come up.
  , losses :: !Int
  , whyLost :: String
  , isClosed :: !Bool
  -- ^ Whether its behaviour has ended.
  }

-- | A topic.
data Kept = Kept
  { newest :: TVar (Maybe Arrival)
  , arrivals :: TVar Int
  , askedAt :: TVar Seconds
  -- ^ When it was last subscribed to.
  , keptType :: Text
  }

-- | A message that came: its number, and when that was.
data Arrival = Arrival
  { arrivalNumber :: !Int
  , arrivedAt :: !Seconds
  , arrived :: Value
  }

-- | A goal that was sent.
data Sent = Sent
  { sentTo :: Text
  -- ^ The action.
  , sentIn :: !Int
  -- ^ The number of the connection.
  , end :: TVar (Maybe End)
  , cancelled :: TVar Bool
  -- ^ Whether we have asked the robot to cancel it.
  , feedback :: TVar (Maybe Value)
  }

-- | How a goal ended, as far as we know.
data End
  = Ended !Int Value
  | Complained Text
  | Lost

-- | A link that is down.
newRos :: String -> RosOptions -> IO Ros
newRos name options =
  Ros name options
    <$> newTVarIO (Link False 0 0 "" False)
    <*> newTBQueueIO 256
    <*> newTVarIO False
    <*> newTVarIO 0
    <*> newTVarIO 1
    <*> newTVarIO Map.empty
    <*> newTVarIO Map.empty
    <*> newTVarIO 0
    <*> newTBQueueIO 64

-- | Whether there is a link. It never fails.
--
-- @since 0.1.0.0
linkUp :: Ros -> Signal Bool
linkUp ros = named "link up" (watching (isUp <$> readTVar (link ros)))

-- | How many frames were refused: too large, too deep, no JSON, or none of rosbridge.
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

-- | The link is up: gives what is to be asked first. (Goals are never sent again.)
comeUp :: Ros -> Seconds -> STM [Request]
comeUp ros time = do
  modifyTVar' (link ros) (\l -> l {isUp = True, connections = connections l + 1})
  topics <- readTVar (kept ros)
  for_ topics (\topic -> writeTVar (askedAt topic) time)
  moving <- nub . map sentTo . Map.elems <$> readTVar (sent ros)
  pure $
    [Subscribe name (keptType topic) | (name, topic) <- Map.toList topics]
      ++ [Subscribe (statusOf action) "action_msgs/msg/GoalStatusArray" | action <- moving]

-- | The link is down, and why. Each goal that waits for its result ends at once, as lost; and what was not sent yet is
-- never sent.
goDown :: Ros -> String -> STM ()
goDown ros why = do
  l <- readTVar (link ros)
  when (isUp l) $ do
    writeTVar (link ros) l {isUp = False, losses = losses l + 1, whyLost = why}
    void (flushTBQueue (outgoing ros))
    writeTVar (pingWanted ros) False
    readTVar (kept ros) >>= traverse_ (\topic -> writeTVar (newest topic) Nothing)
    -- (They stay among those that may still run.)
    readTVar (sent ros) >>= traverse_ (`endWith` Lost)

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
  noServer = throwSTM (NoServer (robot ros))

-- | Asks the bridge. Retries while too much waits to be sent, and while the link is down.
ask :: Ros -> Request -> STM ()
ask ros request = do
  readTVar (link ros) >>= check . isUp
  writeTBQueue (outgoing ros) request

-- | The topic with this name, subscribed to.
keptOf :: Ros -> Text -> Text -> Seconds -> STM Kept
keptOf ros name type' time =
  readTVar (kept ros) >>= \topics -> case Map.lookup name topics of
    Just topic -> pure topic
    Nothing -> do
      topic <- Kept <$> newTVar Nothing <*> newTVar 0 <*> newTVar time <*> pure type'
      writeTVar (kept ros) (Map.insert name topic topics)
      l <- readTVar (link ros)
      when (isUp l) (ask ros (Subscribe name type'))
      pure topic

-- | Whether a goal of ours may still run on this action.
mayRun :: Ros -> Text -> STM Bool
mayRun ros action = any ((== action) . sentTo) <$> readTVar (sent ros)

-- | Takes what came from the bridge at this time.
take :: Ros -> Seconds -> Answer -> STM ()
take ros time answer = case answer of
  Message name value -> do
    topic <- Map.lookup name <$> readTVar (kept ros)
    for_ topic $ \known -> do
      n <- (+ 1) <$> readTVar (arrivals known)
      writeTVar (arrivals known) n
      writeTVar (newest known) (Just (Arrival n time value))
    traverse_ (`takeStatus` value) (Text.stripSuffix "/_action/status" name)
  -- By its id: the result of another goal, which may come late, is not taken for that of this one.
  Result n status values -> goal n >>= traverse_ (\known -> known `endWith` Ended status values >> forget n)
  Feedback n values -> goal n >>= traverse_ (\known -> writeTVar (feedback known) (Just values))
  Complaint (Just n) why ->
    goal n >>= \case
      Nothing -> report ros ("the bridge complains: " ++ Text.unpack why)
      Just known ->
        -- (It may be about a cancel that came too early, and the goal goes on.)
        readTVar (cancelled known) >>= \is -> unless is (known `endWith` Complained why >> forget n)
  Complaint Nothing why -> report ros ("the bridge complains: " ++ Text.unpack why)
  Other _ -> pure ()
 where
  goal n = Map.lookup n <$> readTVar (sent ros)
  forget n = modifyTVar' (sent ros) (Map.delete n)
  -- Goals that were sent in this connection may not have reached their server yet.
  takeStatus action value = case parseEither anyRuns value of
    Left why -> refuse ros why
    Right True -> pure ()
    Right False -> do
      current <- connections <$> readTVar (link ros)
      modifyTVar' (sent ros) (Map.filter (\known -> sentTo known /= action || sentIn known == current))
  anyRuns = withObject "GoalStatusArray" $ \o -> do
    goals <- o .: "status_list"
    any (`notElem` [4, 5, 6 :: Int]) <$> traverse (.: "status") (goals :: [Object])

-- | Ends the goal, unless it has ended.
endWith :: Sent -> End -> STM ()
endWith known how = readTVar (end known) >>= \before -> when (isNothing before) (writeTVar (end known) (Just how))

-- | Counts a frame that was refused, and reports why.
refuse :: Ros -> String -> STM ()
refuse ros why = modifyTVar' (refused ros) (+ 1) >> report ros ("refused: " ++ why)

report :: Ros -> String -> STM ()
report ros line = isFullTBQueue (reports ros) >>= \full -> unless full (writeTBQueue (reports ros) line)

statusOf :: Text -> Text
statusOf action = action <> "/_action/status"
