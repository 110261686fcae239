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
  , decodeSharing
  , NoEvent (..)
  ) where

import Control.Monad (when)
import Data.Aeson (Object, Value (..), eitherDecode, parseJSON, withObject, withText, (.:), (.:?))
import Data.Aeson.Encoding (Encoding, Series, int, list, pair, pairs)
import Data.Aeson.Types (Key, Parser, explicitParseField, explicitParseFieldMaybe, parseEither, typeMismatch)
import Data.ByteString.Builder (Builder, char7)
import qualified Data.ByteString.Lazy as Bytes
import Data.Maybe (fromMaybe)
import Data.Text (Text)
import qualified Data.Text as Text
import Data.Time.Clock (UTCTime)
import Data.Time.Format.ISO8601 (iso8601Show)

import Behavior.Internal.Seconds (Seconds (..))
import Behavior.Trace
import Behavior.Trace.Describe (inertUpTo)
import Behavior.Trace.Json
import Behavior.Trace.Sharing

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

kinds :: [(Text, SpanKind)]
kinds = [("named", Named), ("operator", Operator), ("branch", Branch)]

nameIn :: Eq a => [(Text, a)] -> a -> String
nameIn table x = head [Text.unpack name | (name, y) <- table, x == y]

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
decodeEvent = fmap fst . decodeSharing noTexts

-- | The same, given the texts of the lines before, and with those for the lines after it. Equal texts are in memory once.
--
-- @since 0.1.0.0
decodeSharing :: Texts -> Bytes.ByteString -> Either NoEvent (Event, Texts)
decodeSharing known content
  | nestsDeeperThan 100 content = Left (NotAnEvent "it nests deeper than 100; allowed: an event, which nests 6 deep")
  | otherwise =
      either (Left . NotJson) Right (eitherDecode content)
        >>= either (Left . NotAnEvent) Right . parseEither (runSharing known . event)

event :: Value -> Sharing Event
event = object "an event" $ \o ->
  choose o "event"
    [ ("began", Began <$> spanOf o)
    , ("ended", Ended <$> spanOf o <*> timeAt o "ended" <*> (valueAt o "end" >>= endOf))
    , ("reacted", Reacted <$> reactionOf o)
    , ("lost", Lost <$> parsed (o .: "count" >>= from1 "count"))
    ]

spanOf :: Object -> Sharing Span
spanOf o =
  uncurry Span <$> parsed (numbered o)
    <*> choose o "kind" [(name, pure kind) | (name, kind) <- kinds]
    <*> textAt o "name"
    <*> timeAt o "began"
    <*> parsed (o .:? "reaction")

reactionOf :: Object -> Sharing Reaction
reactionOf o =
  uncurry Reaction <$> parsed (numbered o)
    <*> textAt o "operator"
    <*> timeAt o "time"
    <*> changesAt o
    <*> (parsed (o .:? "stopped") >>= traverse stoppedOf)
    <*> perhapsTextAt o "starts"

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

endOf :: Value -> Sharing End
endOf = object "an end" $ \o ->
  choose o "how"
    [ ("succeeded", pure Succeeded)
    , ("failed", FailedWith <$> textAt o "text")
    , ("faulted", FaultedWith <$> textAt o "text")
    , ("stopped", StoppedBy <$> (valueAt o "cause" >>= causeOf))
    ]

causeOf :: Value -> Sharing Cause
causeOf = object "a cause" $ \o ->
  choose o "why"
    [ ("signal", SignalChanged <$> parsed (o .: "reaction") <*> changesAt o)
    , ("sibling finished", SiblingFinished <$> textAt o "branch")
    , ("sibling failed", SiblingFailed <$> textAt o "branch")
    , ("time limit", TimeLimit <$> timeAt o "limit")
    , ("from outside", FromOutside <$> textAt o "exception")
    , ("abandoned", pure WasAbandoned)
    ]

changesAt :: Object -> Sharing [Change]
changesAt o = parsed (o .: "changes") >>= traverse changeOf
 where
  changeOf = object "a change" $ \c -> Change <$> textAt c "signal" <*> perhapsTextAt c "before" <*> textAt c "after"

stoppedOf :: Value -> Sharing StoppedBranch
stoppedOf = object "a stopped branch" $ \o ->
  StoppedBranch <$> textAt o "name" <*> timeAt o "after" <*> timeAt o "took" <*> (valueAt o "end" >>= endOf)

secondsOf :: Value -> Parser Seconds
secondsOf = \case
  String "inf" -> pure (1 / 0)
  String "-inf" -> pure (-1 / 0)
  String "nan" -> pure (0 / 0)
  number'@(Number _) -> Seconds <$> parseJSON number'
  _ -> fail "a time: allowed: a number, \"inf\", \"-inf\", \"nan\""

object :: String -> (Object -> Sharing a) -> Value -> Sharing a
object what fields value = parsed (withObject what pure value) >>= fields

valueAt :: Object -> Key -> Sharing Value
valueAt o key = parsed (o .: key)

timeAt :: Object -> Key -> Sharing Seconds
timeAt o key = parsed (o .: key >>= secondsOf)

textAt :: Object -> Key -> Sharing String
textAt o key = parsed (explicitParseField aText o key) >>= shared

perhapsTextAt :: Object -> Key -> Sharing (Maybe String)
perhapsTextAt o key = parsed (explicitParseFieldMaybe aText o key) >>= traverse shared

aText :: Value -> Parser Text
aText = \case
  String known -> pure known
  other -> typeMismatch "String" other

-- The field's text selects how the rest is read.
choose :: Object -> Key -> [(Text, Sharing a)] -> Sharing a
choose o key table =
  parsed (o .: key >>= withText (show key) pure) >>= \name -> fromMaybe (parsed (refuse name)) (lookup name table)
 where
  refuse name =
    fail
      (show key ++ " is " ++ show (inertUpTo 60 (Text.unpack name)) ++ "; allowed: "
        ++ Text.unpack (Text.intercalate ", " (map fst table)))
