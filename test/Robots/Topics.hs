{-# LANGUAGE OverloadedStrings #-}

-- |
-- Row 8: topics without messages, topics that fall silent, and latched ones.
module Robots.Topics
  ( silences
  ) where

import Control.Exception (SomeException, displayException)
import Control.Monad (replicateM_)
import Data.Aeson ((.=))
import Data.Foldable (for_)
import Data.Int (Int32)
import Prelude hiding (read)

import Behavior hiding (rSelect)
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Messages
import Behavior.Signal (Signal, rSelect, read, waitUntil)
import Robots.Campaign
import Robots.Goals

silences :: Campaign -> Behavior ()
silences campaign = withBridge campaign 1 $ \_ bridge -> do
  awaitServers campaign 8 bridge ["/steady"]
  replicateM_ (if isLong campaign then 20 else 5) $ do
    for_ ["/nothing", "/nowhere"] $ \name ->
      withRos bridge $ \ros -> awaitBridge ros >> choosing campaign ros "without messages" name (pure ())
    withRos bridge $ \ros -> do
      let bursts = numbers ros "/bursts" (atLeastEvery 10)
          arrivals n = do
            next <- otherThan n bursts
            arrived <- clock
            note campaign 8 ["arrived" .= arrived, "number" .= next]
            arrivals next
      firstOf [arrivals 0, choosing campaign ros "falling silent" "/bursts" (waitUntil (True <$ bursts))]
    withRos bridge $ \ros -> for_ ["first", "second" :: String] $ \reader -> do
      begun <- clock
      n <- read (numbers ros "/kept" latched)
      ended <- clock
      note campaign 8 ["reader" .= reader, "read" .= n, "begun" .= begun, "ended" .= ended]

numbers :: Ros -> String -> Silence -> Signal Int32
numbers ros name silence = unStd <$> latest ros (topic name silence)

-- | Chooses between two goals by a topic's messages, until that faults. (All numbers are below a million: so the right
-- one is never chosen.)
choosing :: Campaign -> Ros -> String -> String -> Behavior () -> Behavior ()
choosing campaign ros what name first = do
  first
  begun <- clock
  let branch side = uninterrupted campaign 8 [("branch", side)] (plainly ros (fibonacci "/steady"))
  how <- tryAny (rSelect ((>= 1000000) <$> numbers ros name (atLeastEvery 0.5)) (branch "right") (branch "left"))
  ended <- clock
  note campaign 8 ["what" .= what, "topic" .= name, "begun" .= begun, "ended" .= ended, "fault" .= said how]
 where
  said = either displayException (const "none") :: Either SomeException () -> String
