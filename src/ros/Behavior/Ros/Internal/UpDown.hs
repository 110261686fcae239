{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What becomes of goals, calls, topics and publishers when a link comes up and goes down.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.UpDown
  ( comeUp
  , goDown
  , settle
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Monad (when)
import Data.Foldable (for_, traverse_)
import Data.List (nub)
import qualified Data.Map.Strict as Map
import Data.Proxy (Proxy (..))
import Data.Text (Text)

import Behavior (Seconds)
import Behavior.Ros.Internal.Frame
import Behavior.Ros.Internal.Link
import Behavior.Ros.Internal.Message (messageType)
import Behavior.Ros.Internal.Options
import Behavior.Ros.Internal.Sent
import Behavior.Ros.Internal.Status (Statuses, statusOf)

-- | The link is up: gives what is to be asked first. (Goals are never sent again.)
comeUp :: Ros -> Seconds -> STM [Request]
comeUp ros time = do
  modifyTVar' (link ros) (\l -> l {isUp = True, connections = connections l + 1})
  topics <- readTVar (kept ros)
  for_ topics (\topic -> writeTVar (askedAt topic) time)
  topicsOfOurs <- readTVar (advertised ros)
  before <- Map.elems <$> readTVar (sent ros)
  for_ before $ \known -> do
    writeTVar (isAbsent known) False
    modifyTVar' (arrivedBy known) (min (time + patience (rosOptions ros)))
  let moving = [action | action <- nub (map sentTo before), statusOf action `Map.notMember` topics]
  pure $
    [Advertise name typeName keeps | (name, Advertised typeName keeps _) <- Map.toList topicsOfOurs]
      ++ [Subscribe name (keptType topic) | (name, topic) <- Map.toList topics]
      ++ [Subscribe (statusOf action) typeOfStatus | action <- moving]

-- | The link is down, and why. Each goal that waits for its result ends at once, as lost; and what was not sent yet is
-- never sent.
goDown :: Ros -> String -> STM ()
goDown ros why = do
  l <- readTVar (link ros)
  writeTVar (link ros) l {isUp = False, whyDown = why}
  when (isUp l) $ do
    modifyTVar' (link ros) (\down -> down {losses = losses down + 1, whyLost = why})
    for_ [outgoing ros, cancels ros] flushTBQueue
    writeTVar (pingWanted ros) False
    writeTVar (isReading ros) False
    readTVar (kept ros) >>= traverse_ (\topic -> writeTVar (newest topic) Nothing)
    -- (They stay among those that may still run.)
    readTVar (sent ros) >>= traverse_ (\(n, known) -> leave ros n known Lost) . Map.toList
    readTVar (calls ros) >>= traverse_ (`setOnce` NoReply)

-- | The goals of earlier connections have come to their servers by now: those that are absent have ended. Of the others
-- it asks again; gives whether there are any.
settle :: Ros -> STM Bool
settle ros = do
  absent <- readTVar (sent ros) >>= traverse (readTVar . isAbsent)
  modifyTVar' (sent ros) (`Map.difference` Map.filter id absent)
  connection <- connections <$> readTVar (link ros)
  older <- filter ((< connection) . sentIn) . Map.elems <$> readTVar (sent ros)
  -- (A bridge that has just started may not have what was said before it knew the server.)
  for_ (nub (map sentTo older)) $ \action -> subscribeAgain ros (statusOf action) typeOfStatus
  pure (not (null older))

typeOfStatus :: Text
typeOfStatus = messageType (Proxy :: Proxy Statuses)
