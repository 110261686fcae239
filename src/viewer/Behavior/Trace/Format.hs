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

import Control.Monad (when)
import Data.Aeson (Object, Value (..), eitherDecode, parseJSON, withObject, withText, (.:), (.:?))
import Data.Aeson.Encoding (Encoding, Series, int, list, pair, pairs)
import Data.Aeson.Types (Key, Parser, parseEither)
import Data.ByteString.Builder (Builder, char7)
import qualified Data.ByteString.Lazy as Bytes
import Data.List (intercalate)
import Data.Maybe (fromMaybe)
import qualified Data.Text as Text
import Data.Time.Clock (UTCTime)
import Data.Time.Format.ISO8601 (iso8601Show)

import Behavior.Internal.Seconds (Seconds (..))
import Behavior.Trace
import Behavior.Trace.Describe (inertUpTo)
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

kinds :: [(String, SpanKind)]
kinds = [("named", Named), ("operator", Operator), ("branch", Branch)]

nameIn :: Eq a => [(String, a)] -> a -> String
nameIn table x = head [name | (name, y) <- table, x == y]

-- | Why a line is no event.
--
-- @since 0.1.0.0
data NoEvent
  = -- | It is not JSON, for example because it is incomplete.
    NotJson String
  | -- | It is JSON, but not that of an event.
    NotAnEvent String
  deriving (Eq, Show)

-- | The event of a line.
--
-- @since 0.1.0.0
decodeEvent :: Bytes.ByteString -> Either NoEvent Event
decodeEvent content
  | nestsDeeperThan 100 content = Left (NotAnEvent "it nests deeper than 100; allowed: an event, which nests 6 deep")
  | otherwise =
      either (Left . NotJson) Right (eitherDecode content) >>= either (Left . NotAnEvent) Right . parseEither event

event :: Value -> Parser Event
event = withObject "an event" $ \o ->
  choose o "event"
    [ ("began", Began <$> spanOf o)
    , ("ended", Ended <$> spanOf o <*> (o .: "ended" >>= secondsOf) <*> (o .: "end" >>= endOf))
    , ("reacted", Reacted <$> reactionOf o)
    , ("lost", Lost <$> (o .: "count" >>= from1 "count"))
    ]

spanOf :: Object -> Parser Span
spanOf o =
  uncurry Span <$> numbered o
    <*> choose o "kind" [(name, pure kind) | (name, kind) <- kinds]
    <*> o .: "name"
    <*> (o .: "began" >>= secondsOf)
    <*> o .:? "reaction"

reactionOf :: Object -> Parser Reaction
reactionOf o =
  uncurry Reaction <$> numbered o
    <*> o .: "operator"
    <*> (o .: "time" >>= secondsOf)
    <*> (o .: "changes" >>= traverse changeOf)
    <*> (o .:? "stopped" >>= traverse stoppedOf)
    <*> o .:? "starts"

-- What something is in began before it. So nothing is in itself.
numbered :: Object -> Parser (Int, Parent)
numbered o = do
  n <- o .: "number" >>= from1 "number"
  parent <- o .: "parent" >>= parentOf
  case parent of
    Inside p
      | p < 1 || p >= n ->
          fail ("parent is " ++ show p ++ "; allowed: a number from 1 that is less than its own, " ++ show n)
    _ -> pure (n, parent)

from1 :: String -> Int -> Parser Int
from1 key n = n <$ when (n < 1) (fail (key ++ " is " ++ show n ++ "; allowed: a whole number from 1"))

parentOf :: Value -> Parser Parent
parentOf = \case
  String "top" -> pure Top
  String "unknown" -> pure UnknownParent
  number'@(Number _) -> Inside <$> parseJSON number'
  _ -> fail "parent: allowed: a number, \"top\", \"unknown\""

endOf :: Value -> Parser End
endOf = withObject "an end" $ \o ->
  choose o "how"
    [ ("succeeded", pure Succeeded)
    , ("failed", FailedWith <$> o .: "text")
    , ("faulted", FaultedWith <$> o .: "text")
    , ("stopped", StoppedBy <$> (o .: "cause" >>= causeOf))
    ]

causeOf :: Value -> Parser Cause
causeOf = withObject "a cause" $ \o ->
  choose o "why"
    [ ("signal", SignalChanged <$> o .: "reaction" <*> (o .: "changes" >>= traverse changeOf))
    , ("sibling finished", SiblingFinished <$> o .: "branch")
    , ("sibling failed", SiblingFailed <$> o .: "branch")
    , ("time limit", TimeLimit <$> (o .: "limit" >>= secondsOf))
    , ("from outside", FromOutside <$> o .: "exception")
    , ("abandoned", pure WasAbandoned)
    ]

changeOf :: Value -> Parser Change
changeOf = withObject "a change" $ \o -> Change <$> o .: "signal" <*> o .:? "before" <*> o .: "after"

stoppedOf :: Value -> Parser StoppedBranch
stoppedOf = withObject "a stopped branch" $ \o ->
  StoppedBranch
    <$> o .: "name"
    <*> (o .: "after" >>= secondsOf)
    <*> (o .: "took" >>= secondsOf)
    <*> (o .: "end" >>= endOf)

secondsOf :: Value -> Parser Seconds
secondsOf = \case
  String "inf" -> pure (1 / 0)
  String "-inf" -> pure (-1 / 0)
  String "nan" -> pure (0 / 0)
  number'@(Number _) -> Seconds <$> parseJSON number'
  _ -> fail "a time: allowed: a number, \"inf\", \"-inf\", \"nan\""

-- The field's text selects how the rest is read.
choose :: Object -> Key -> [(String, Parser a)] -> Parser a
choose o key table =
  o .: key >>= withText (show key) (\name -> fromMaybe (refuse (Text.unpack name)) (lookup (Text.unpack name) table))
 where
  refuse name =
    fail (show key ++ " is " ++ show (inertUpTo 60 name) ++ "; allowed: " ++ intercalate ", " (map fst table))
