{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The lines of a file with a trace. @docs\/trace-format.md@ describes each field.
module Behavior.Trace.Format
  ( -- * The header
    Header (..)
  , encodeHeader
  , formatName
  , formatVersion

    -- * Events
  , encodeEvent
  , decodeEvent
  , NoEvent (..)
  ) where

import Data.Aeson.Encoding (Encoding, Series, int, list, pair, pairs)
import Data.Aeson.Types (Key)
import Data.ByteString.Builder (Builder, char7)
import Data.Text (Text)
import qualified Data.Text as Text
import Data.Time.Clock (UTCTime)
import Data.Time.Format.ISO8601 (iso8601Show)

import Behavior.Internal.Core.Seconds (Seconds (..))
import Behavior.Trace
import Behavior.Trace.Decode
import Behavior.Trace.Json

-- | The first line of a file.
--
-- @since 0.1.0.0
newtype Header = Header
  { zeroTime :: UTCTime
  -- ^ The time of day at which the times of the events are 0.
  }
  deriving (Eq, Ord, Show)

-- | The version of the format that this module writes and reads.
--
-- @since 0.1.0.0
formatVersion :: Int
formatVersion = 1

-- | The first line.
--
-- @since 0.1.0.0
encodeHeader :: Header -> Builder
encodeHeader (Header zero) =
  line (pair "format" (text formatName) <> pair "version" (int formatVersion) <> pair "zero" (text (iso8601Show zero)))

-- | How the header names the format.
--
-- @since 0.1.0.0
formatName :: String
formatName = "behavior-trace"

-- | The line of an event.
--
-- @since 0.1.0.0
encodeEvent :: Event -> Builder
encodeEvent =
  line . \case
    Began s -> pair "event" (text "began") <> spanFields s
    Ended s t end ->
      pair "event" (text "ended") <> spanFields s <> pair "ended" (seconds t) <> pair "end" (encodeEnd end)
    Reacted r ->
      pair "event" (text "reacted")
        <> pair "number" (int (reactionNumber r))
        <> pair "parent" (encodeParent (reactionParent r))
        <> pair "operator" (text (reactionOperator r))
        <> pair "time" (seconds (reactionTime r))
        <> pair "changes" (list encodeChange (reactionChanges r))
        <> optional "stopped" encodeStopped (reactionStopped r)
        <> optional "starts" text (reactionStarts r)
    Lost n -> pair "event" (text "lost") <> pair "count" (int n)

line :: Series -> Builder
line fields = written (pairs fields) <> char7 '\n'

spanFields :: Span -> Series
spanFields s =
  pair "number" (int (spanNumber s))
    <> pair "parent" (encodeParent (spanParent s))
    <> pair "kind" (text (nameIn kinds (spanKind s)))
    <> pair "name" (text (spanName s))
    <> pair "began" (seconds (spanBegan s))
    <> optional "reaction" int (spanReaction s)

encodeParent :: Parent -> Encoding
encodeParent = \case
  Inside n -> int n
  Top -> text "top"
  UnknownParent -> text "unknown"

encodeEnd :: End -> Encoding
encodeEnd =
  pairs . \case
    Succeeded -> pair "how" (text "succeeded")
    FailedWith why -> pair "how" (text "failed") <> pair "text" (text why)
    FaultedWith why -> pair "how" (text "faulted") <> pair "text" (text why)
    StoppedBy cause -> pair "how" (text "stopped") <> pair "cause" (encodeCause cause)

encodeCause :: Cause -> Encoding
encodeCause =
  pairs . \case
    SignalChanged n changes ->
      pair "why" (text "signal") <> pair "reaction" (int n) <> pair "changes" (list encodeChange changes)
    SiblingFinished branch -> pair "why" (text "sibling finished") <> pair "branch" (text branch)
    SiblingFailed branch -> pair "why" (text "sibling failed") <> pair "branch" (text branch)
    TimeLimit t -> pair "why" (text "time limit") <> pair "limit" (seconds t)
    FromOutside exception -> pair "why" (text "from outside") <> pair "exception" (text exception)
    WasAbandoned -> pair "why" (text "abandoned")

encodeChange :: Change -> Encoding
encodeChange c =
  pairs $
    pair "signal" (text (changeSignal c))
      <> optional "before" text (changeBefore c)
      <> pair "after" (text (changeAfter c))

encodeStopped :: StoppedBranch -> Encoding
encodeStopped s =
  pairs $
    pair "name" (text (stoppedName s))
      <> pair "after" (seconds (stoppedAfter s))
      <> pair "took" (seconds (stoppingTook s))
      <> pair "end" (encodeEnd (stoppedEnd s))

seconds :: Seconds -> Encoding
seconds (Seconds t) = number t

optional :: Key -> (a -> Encoding) -> Maybe a -> Series
optional key encode = maybe mempty (pair key . encode)

nameIn :: Eq a => [(Text, a)] -> a -> String
nameIn table x = head [Text.unpack name | (name, y) <- table, x == y]
