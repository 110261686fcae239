{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The messages between a robot and a reader of its live page. @docs\/live-protocol.md@ describes each field.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Protocol
  ( protocolVersion

    -- * From the robot
  , Run (..)
  , hello
  , snapshotMessage
  , eventsMessage
  , beat
  , over
  , refusal

    -- * From a reader
  , Attach (..)
  , readAttach
  , attachMessage
  ) where

import Data.Aeson (eitherDecode, withObject, (.:), (.:?))
import Data.Aeson.Encoding (Series, int, pair, pairs)
import qualified Data.Aeson.Encoding as Encoding
import Data.Aeson.Types (parseEither)
import Data.ByteString.Builder (Builder, lazyByteString, toLazyByteString)
import qualified Data.ByteString.Lazy.Char8 as Bytes
import Data.List (intersperse)
import Data.Text (Text)
import Data.Time.Clock (UTCTime)
import Data.Time.Format.ISO8601 (iso8601Show)

import Behavior.Internal.Core.Seconds (Seconds (..))
import Behavior.Live.Internal.History
import Behavior.Trace.Json (number, text, written)

-- | The version of the protocol. A reader that wants another one is refused.
protocolVersion :: Int
protocolVersion = 1

-- | What is always the same of a run.
data Run = Run
  { robotName :: String
  , runName :: String
  -- ^ Another one for each run, so that a reader that comes back knows whether its numbers still count.
  , zeroAt :: UTCTime
  -- ^ When the times of the events are 0.
  }

-- | The first message.
hello :: Run -> Bytes.ByteString
hello run =
  message "hello" $
    pair "version" (int protocolVersion)
      <> pair "robot" (text (robotName run))
      <> pair "run" (text (runName run))
      <> pair "zero" (text (iso8601Show (zeroAt run)))

-- | What someone who comes late has to know.
snapshotMessage :: Seconds -> History -> Bytes.ByteString
snapshotMessage now history =
  withLists
    (message "snapshot" (standing now history))
    [("running", runningNow s), ("ended", lastEnded s), ("reacted", lastReacted s)]
 where
  s = snapshot history

-- | The events of a chunk.
eventsMessage :: Chunk -> Bytes.ByteString
eventsMessage chunk =
  withLists
    (message "events" (pair "from" (int (firstNumber chunk)) <> pair "next" (int (afterLast chunk))))
    [("events", [encoded chunk])]

-- | That the robot is there.
beat :: Seconds -> History -> Bytes.ByteString
beat now history = message "beat" (standing now history)

-- | That the run is over: the last message.
over :: Seconds -> History -> Bytes.ByteString
over now history = message "over" (standing now history)

-- | Why the reader receives nothing else.
refusal :: String -> Bytes.ByteString
refusal why = message "refused" (pair "why" (text why))

standing :: Seconds -> History -> Series
standing (Seconds now) history =
  pair "now" (number now) <> pair "next" (int (nextNumber history)) <> pair "lost" (int (lostSoFar history))

message :: String -> Series -> Bytes.ByteString
message kind fields = toLazyByteString (written (pairs (pair "message" (text kind) <> fields)))

-- The object with fields that are lists of what is already encoded.
withLists :: Bytes.ByteString -> [(Builder, [Bytes.ByteString])] -> Bytes.ByteString
withLists object fields = toLazyByteString (lazyByteString (Bytes.init object) <> foldMap field fields <> "}")
 where
  field (name, elements) = ",\"" <> name <> "\":[" <> mconcat (intersperse "," (map lazyByteString elements)) <> "]"

-- | What a reader says first, and only then.
data Attach = Attach
  { wantedVersion :: Int
  , shownToken :: Maybe Text
  , knownUntil :: Maybe (Text, Int)
  -- ^ Of a reader that comes back: the run, and the number of the event that it wants next.
  }
  deriving (Eq, Show)

-- | Of this text, or what is wrong with it.
readAttach :: Bytes.ByteString -> Either String Attach
readAttach bytes = eitherDecode bytes >>= parseEither attach
 where
  attach = withObject "attach" $ \o ->
    Attach <$> o .: "version" <*> o .:? "token" <*> (both <$> o .:? "run" <*> o .:? "next")
  both known n = (,) <$> known <*> n

-- | The message of which 'readAttach' reads this.
attachMessage :: Attach -> Bytes.ByteString
attachMessage (Attach version shown known) =
  toLazyByteString . written . pairs $
    pair "version" (int version)
      <> foldMap (pair "token" . Encoding.text) shown
      <> foldMap (\(name, n) -> pair "run" (Encoding.text name) <> pair "next" (int n)) known
