{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- How the line of an event is read. "Behavior.Trace.Format" writes it.
module Behavior.Trace.Decode
  ( decodeEvent
  , decodeSharing
  , NoEvent (..)
  , kinds
  ) where

import Control.Monad (when)
import Data.Aeson (Object, Value (..), eitherDecode, parseJSON, withObject, withText, (.:), (.:?))
import Data.Aeson.Types (Key, Parser, explicitParseField, explicitParseFieldMaybe, parseEither, typeMismatch)
import qualified Data.ByteString.Lazy as Bytes
import Data.Maybe (fromMaybe)
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior.Internal.Core.Seconds (Seconds (..))
import Behavior.Internal.Nesting (nestsDeeperThan)
import Behavior.Trace
import Behavior.Trace.Describe (inertUpTo)
import Behavior.Trace.Sharing

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

-- | The same, given the texts of the lines before, and with the texts for the line after it. Equal ones are kept once.
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

-- | How the kinds of spans are written.
kinds :: [(Text, SpanKind)]
kinds = [("named", Named), ("operator", Operator), ("branch", Branch)]

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
  value@(Number _) -> Inside <$> parseJSON value
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
  value@(Number _) -> Seconds <$> parseJSON value
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
