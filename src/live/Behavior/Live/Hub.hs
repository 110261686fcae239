{-# LANGUAGE OverloadedStrings #-}

-- |
-- One live page for many robots.
--
-- > main = runBehavior (hub loopback {pageRobot = "fleet", pagePort = 8410} robots >>= putStrLn)
-- >  where
-- >   robots = pure [("Ann", "http://127.0.0.1:8420/"), ("Bob", "http://127.0.0.1:8421/")]
--
-- Each robot has its own server ("Behavior.Live"), and the hub is a reader of it. The page of the hub shows what each
-- robot does; the page of one robot is opened from there, at the same address. @docs\/live-page.md@ says what it shows.
module Behavior.Live.Hub
  ( hub

    -- * The page
  , LivePage (..)
  , loopback
  ) where

import Control.Monad (void, when)
import qualified Data.ByteString.Lazy as Bytes
import qualified Data.Map.Strict as Map
import Data.Text (Text)
import GHC.Clock (getMonotonicTime)

import Behavior (Behavior)
import Behavior.Live.Internal.Overview
import Behavior.Live.Internal.Page
import Behavior.Live.Internal.Reading
import Behavior.Live.Internal.Robots
import Behavior.Live.Internal.Serving
import Behavior.Live.Internal.Site
import Behavior.Parallel (firstOf)
import Behavior.STM
import Behavior.Time (every)

-- | Serves one page of all robots that the transaction gives: the name under which each is shown, and the address of
-- its own live page (with the token, as the robot prints it). When it gives others, the page shows those.
--
-- The address of the page is printed on @stderr@. Like a robot's own page, it only shows, and is for this machine
-- unless it has a token. Robots have to be on this machine, too, or at the end of a tunnel to another one. A robot that
-- is not there, is silent, or says what is not allowed is grey, with what was known of it; it is tried again every
-- second, and changes nothing for the others.
--
-- [Result] Only if there can be no page: why.
-- [Failure, fault] Those of the transaction.
-- [Cancellation] Ends the server and all connections.
--
-- @since 0.1.0.0
hub :: LivePage -> STM [(String, String)] -> Behavior String
hub page wanted = withListener page (pure . ("no page: " ++)) $ \listener@(Listener _ token here) -> do
  robots <- newTVarIO (Robots Map.empty 0)
  current <- newTVarIO (0, Bytes.empty)
  readers <- newTVarIO 0
  let site =
        Site
          { onlyForHere = here
          , secret = token
          , fileAt = hubFile
          , tellingAt = telling robots current
          , connected = readers
          }
  firstOf
    [ following wanted robots
    , every 0.3 (publishing (pageRobot page) robots current)
    , "no page: its server has ended" <$ serve listener (application site)
    ]

-- The page at PATH/ has its websocket at PATH/live.
telling :: TVar Robots -> TVar (Int, Bytes.ByteString) -> [Text] -> Maybe Telling
telling robots current path = case path of
  ["live"] -> Just (tellingAll current)
  ["robots", name, "live"] -> Just (relaying robots name)
  _ -> Nothing

-- | Makes the next message, for all readers.
publishing :: String -> TVar Robots -> TVar (Int, Bytes.ByteString) -> IO ()
publishing title robots current = do
  time <- getMonotonicTime
  atomically $ do
    Robots these more <- readTVar robots
    now <- traverse (readTVar . seen) these
    modifyTVar' current (\(n, _) -> (n + 1, overview title time now more))

-- | Sends the newest message: a slow reader misses those between. With each sixteenth, some five seconds, a ping.
tellingAll :: TVar (Int, Bytes.ByteString) -> Telling
tellingAll current say ping _ = go (0 :: Int) 0
 where
  go count before = do
    (n, message) <- atomically (readTVar current >>= \newest -> newest <$ check (fst newest /= before))
    say message
    when (count `mod` 16 == 0) ping
    go (count + 1) n

-- | Passes on what this robot says to a reader of its own. Each such reader has a connection to the robot: so one that
-- is slow is slow for the robot's server, which leaves events out for it, and for no other reader.
relaying :: TVar Robots -> Text -> Telling
relaying robots name say ping wanted = do
  found <- Map.lookup name . followed <$> readTVarIO robots
  case found >>= either (const Nothing) Just . place of
    Nothing -> pure ()
    Just address -> void . reading address wanted $ \next -> go next 0
 where
  go next due = do
    next >>= say
    time <- getMonotonicTime
    if time < due then go next due else ping >> go next (time + 5)
