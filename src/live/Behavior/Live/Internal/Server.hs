{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The server of a live page. It only shows: no message of a reader changes anything in the mission.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Server
  ( application
  ) where

import Control.Concurrent.STM
import Control.Monad (guard, when)
import Data.Foldable (traverse_)
import qualified Data.Text as Text
import GHC.Clock (getMonotonicTime)
import Network.Wai (Application)
import System.Timeout (timeout)

import Behavior.Live.Internal.History
import Behavior.Live.Internal.Page
import Behavior.Live.Internal.Protocol
import Behavior.Live.Internal.Shown
import Behavior.Live.Internal.Site hiding (application)
import qualified Behavior.Live.Internal.Site as Site

-- | The page, and the websocket of its readers.
application :: Shown -> Application
application shown =
  Site.application
    Site
      { onlyForHere = onlyHere shown
      , secret = token shown
      , fileAt = pageFile
      , tellingAt = \path -> telling shown <$ guard (path == ["live"])
      , connected = readers shown
      }

-- Sends a reader all that comes; with each sixteenth beat, some five seconds, a ping.
telling :: Shown -> Telling
telling shown say ping wanted = do
  say (hello (run shown))
  begun <- readTVarIO (history shown)
  cursor <- case knownUntil wanted of
    Just (known, n) | known == Text.pack (runName (run shown)), Just _ <- chunksFrom n begun -> pure n
    _ -> whole begun
  follow (0 :: Int) 0 cursor
 where
  -- How many beats there were, when the next one is due, and the number of the event to tell next.
  follow beats due cursor = do
    t <- getMonotonicTime
    if t < due then waiting (due - t) cursor >>= maybe (pure ()) (follow beats due) else do
      atTime beat =<< readTVarIO (history shown)
      when (beats `mod` 16 == 0) ping
      follow (beats + 1) (t + 0.3) cursor
  -- Sends what comes in that time; then the next number, or nothing if all is over.
  waiting time cursor = do
    _ <- timeout (ceiling (1000000 * time)) . atomically $ do
      next <- nextNumber <$> readTVar (history shown)
      complete <- readTVar (isComplete shown)
      check (next /= cursor || complete)
    (after, complete) <- atomically ((,) <$> readTVar (history shown) <*> readTVar (isComplete shown))
    next <- case chunksFrom cursor after of
      Just new -> nextNumber after <$ traverse_ (say . eventsMessage) new
      Nothing -> whole after
    if complete then Nothing <$ atTime over after else pure (Just next)
  whole current = nextNumber current <$ atTime snapshotMessage current
  atTime message current = clock shown current >>= \t -> say (message t current)
