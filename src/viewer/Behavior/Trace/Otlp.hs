{-# LANGUAGE OverloadedStrings #-}

-- |
-- A recording as a trace of OpenTelemetry: OTLP in JSON, which its collector receives, and Jaeger and Tempo.
-- @docs\/seeing-a-robot.md@ says which field is what.
module Behavior.Trace.Otlp
  ( renderOtlp
  ) where

import Data.Aeson.Encoding (Encoding, Series, int, list, pair, pairs)
import Data.Bits (shiftR, xor, (.|.))
import Data.ByteString.Builder (toLazyByteString)
import qualified Data.ByteString.Lazy as Lazy
import qualified Data.IntMap.Strict as IntMap
import Data.List (intersperse, mapAccumL)
import qualified Data.Map.Strict as Map
import Data.Maybe (isNothing)
import Data.Time.Clock (UTCTime, nominalDiffTimeToSeconds)
import Data.Time.Clock.POSIX (utcTimeToPOSIXSeconds)
import Data.Word (Word64)
import Numeric (showHex)

import Behavior.Internal.Core.Seconds (Seconds (..))
import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Format (Header (..))
import Behavior.Trace.Json
import Behavior.Trace.Recording

-- $setup
-- >>> import Behavior.Trace
-- >>> import Behavior.Trace.Format
-- >>> import Behavior.Trace.Recording
-- >>> import qualified Data.ByteString.Lazy.Char8 as Bytes

-- | The bytes of the file: one request in one line, with a span for each span. The first argument is the name of the
-- service, as a robot is called there; the header has the time of day at which the recording's times are 0.
--
-- The identifiers are made of that time and of the numbers of the spans: so they are the same each time, and those of
-- another run are others. A span that has not ended lasts until the end of the recording, and its outcome is
-- @not ended@. A reaction is an event of the span in which its operator runs; if that is not known, a span of its own.
-- What a reaction started has a link to the first span that it stopped.
--
-- Every recording can be rendered. One span cannot end before it begins, and no time is before 1970 or after 2262:
-- such times are moved there. Of texts there are the first 1,000 characters, of names and values 200.
--
-- >>> let noon = Header (read "2026-01-31 12:00:00Z")
-- >>> let enter = Ended (Span 1 Top Named "enter" 0.5 Nothing) 2 (FailedWith "locked")
-- >>> let made = renderOtlp "Ann" noon (recording [enter])
-- >>> Bytes.putStrLn (Bytes.take 85 made)
-- {"resourceSpans":[{"resource":{"attributes":[{"key":"service.name","value":{"stringVa
-- >>> Bytes.putStr (Bytes.drop (Bytes.length made - 47) made)
-- ,"status":{"code":2,"message":"locked"}}]}]}]}
--
-- @since 0.1.0.0
renderOtlp :: String -> Header -> Recording -> Lazy.ByteString
renderOtlp service header r =
  toLazyByteString $
    "{\"resourceSpans\":[{\"resource\":" <> written (pairs (attributes resource))
      <> ",\"scopeSpans\":[{\"scope\":{\"name\":\"behavior-lang\"},\"spans\":["
      <> mconcat (intersperse "," (map written spans))
      <> "]}]}]}\n"
 where
  resource = [textual "service.name" (nameText service), whole "behavior.lost" (recordingLost r)]
  spans = foldr (below Nothing) (map (alone shared) outside) (recordingRoots r)
  below parent n rest = spanOf shared r parent inside links n : foldr (below (Just k)) rest (nodeChildren n)
   where
    k = spanNumber (nodeSpan n)
    inside = IntMap.findWithDefault [] k reactions
    links = IntMap.lookup k interruptions
  (outside, reactions) = reactionsInside r
  shared = sharedBy (zeroTime header)
  -- From what a reaction started to the first span that it stopped, with the reaction: by the started one's number.
  interruptions =
    IntMap.fromList
      [ (spanNumber s, (reaction, spanNumber first))
      | (reaction, (first : _, started)) <- IntMap.toList (reactionSpans r)
      , s <- started
      ]

-- * What all spans share

data Shared = Shared
  { traceId :: Encoding
  , spanId :: Int -> Encoding
  , unixTime :: Integer -> Encoding
  -- ^ Of nanoseconds since the zero of the recording.
  }

-- Multiplied by an odd number, different numbers are different ones, and only 0 is 0. So no two identifiers of a run
-- are equal, and none is all zero, which receivers refuse.
sharedBy :: UTCTime -> Shared
sharedBy zero =
  Shared
    { traceId = text (hexadecimal (scattered key) ++ hexadecimal key)
    , spanId = \n -> text (hexadecimal (key * fromIntegral n))
    , unixTime = \t -> text (show (max 0 (min (2 ^ (63 :: Int) - 1) (start + t))))
    }
 where
  start = floor (nominalDiffTimeToSeconds (utcTimeToPOSIXSeconds zero) * 1000000000) :: Integer
  key = scattered (fromInteger start) .|. 1

-- | Other arguments have other results, and these have nothing else in common.
scattered :: Word64 -> Word64
scattered = step . step . step
 where
  step x = let y = x + 0x9E3779B97F4A7C15 in (y `xor` (y `shiftR` 31)) * 0xD1342543DE82EF95

hexadecimal :: Word64 -> String
hexadecimal n = replicate (16 - length digits) '0' ++ digits
 where
  digits = showHex n ""

-- * Spans

-- | The span in its parent, with the reactions in it, and what it interrupted.
spanOf :: Shared -> Recording -> Maybe Int -> [Reaction] -> Maybe (Int, Int) -> Node -> Encoding
spanOf shared r parent reactions interruption n =
  pairs $
    identified shared parent (spanNumber s) (spanName s) begin (max begin (nanoseconds (nodeUntil r n)))
      <> attributes (about ++ maybe [] (reasons . snd) (nodeEnd n))
      <> given "events" (map (eventOf shared) reactions)
      <> given "links" [pairs (link l) | Just l <- [interruption]]
      <> maybe mempty (status . snd) (nodeEnd n)
 where
  s = nodeSpan n
  begin = nanoseconds (spanBegan s)
  about =
    [ whole "behavior.number" (spanNumber s)
    , textual "behavior.kind" (kindText (spanKind s))
    , textual "behavior.outcome" (outcomeName (snd <$> nodeEnd n))
    ]
      ++ [textual "behavior.parent" "unknown" | isNothing parent, spanParent s /= Top]
      ++ [whole "behavior.started_by" reaction | Just reaction <- [spanReaction s]]
  link (reaction, stopped) =
    pair "traceId" (traceId shared)
      <> pair "spanId" (spanId shared stopped)
      <> attributes [whole "behavior.reaction" reaction]
  given key made = if null made then mempty else pair key (list id made)

kindText :: SpanKind -> String
kindText kind = case kind of
  Named -> "named"
  Operator -> "operator"
  Branch -> "branch"

-- | A reaction in no span that is known. It took no time.
alone :: Shared -> Reaction -> Encoding
alone shared x =
  pairs $
    identified shared Nothing (reactionNumber x) (reactionOperator x) time time
      <> attributes (textual "behavior.kind" "reaction" : reactionAttributes x)
 where
  time = nanoseconds (reactionTime x)

identified :: Shared -> Maybe Int -> Int -> String -> Integer -> Integer -> Series
identified shared parent n name begin end =
  pair "traceId" (traceId shared)
    <> pair "spanId" (spanId shared n)
    <> maybe mempty (pair "parentSpanId" . spanId shared) parent
    <> pair "name" (text (nameText name))
    -- SPAN_KIND_INTERNAL: no part of it is on another machine.
    <> pair "kind" (int 1)
    <> pair "startTimeUnixNano" (unixTime shared begin)
    <> pair "endTimeUnixNano" (unixTime shared end)

-- | STATUS_CODE_ERROR, or none: that a span was stopped is no error.
status :: End -> Series
status end = case end of
  FailedWith why -> erroneous why
  FaultedWith why -> erroneous why
  _ -> mempty
 where
  erroneous why = pair "status" (pairs (pair "code" (int 2) <> pair "message" (text (inert why))))

-- | Why it was stopped.
reasons :: End -> [Encoding]
reasons end = case end of
  StoppedBy cause -> textual "behavior.stopped.text" (causeText cause) : case cause of
    SignalChanged reaction changes -> why "signal" : whole "behavior.stopped.reaction" reaction : signals changes
    SiblingFinished branch -> [why "sibling finished", textual "behavior.stopped.sibling" (nameText branch)]
    SiblingFailed branch -> [why "sibling failed", textual "behavior.stopped.sibling" (nameText branch)]
    TimeLimit limit -> [why "time limit", lasting "behavior.stopped.limit" limit]
    FromOutside exception -> [why "from outside", textual "behavior.stopped.exception" (inert exception)]
    WasAbandoned -> [why "abandoned"]
  _ -> []
 where
  why = textual "behavior.stopped.why"

-- * Reactions

eventOf :: Shared -> Reaction -> Encoding
eventOf shared x =
  pairs $
    pair "timeUnixNano" (unixTime shared (nanoseconds (reactionTime x)))
      <> pair "name" (text "reaction")
      <> attributes (reactionAttributes x)

reactionAttributes :: Reaction -> [Encoding]
reactionAttributes x =
  [ whole "behavior.reaction" (reactionNumber x)
  , textual "behavior.operator" (nameText (reactionOperator x))
  , textual "behavior.text" (reactionText [] Nothing x)
  ]
    ++ signals (reactionChanges x)
    ++ maybe [] stopped (reactionStopped x)
    ++ [textual "behavior.starts" (nameText branch) | Just branch <- [reactionStarts x]]
 where
  stopped b =
    [ textual "behavior.stopped.branch" (nameText (stoppedName b))
    , lasting "behavior.stopped.after" (stoppedAfter b)
    , lasting "behavior.stopped.took" (stoppingTook b)
    , textual "behavior.stopped.outcome" (outcomeText (Just (stoppedEnd b)))
    ]

-- | The values of each signal. (No two attributes have the same key: the second signal of a name is called @name 2@.)
signals :: [Change] -> [Encoding]
signals changes = concat (snd (mapAccumL values Map.empty changes))
 where
  values seen c = (Map.insert name (times + 1) seen, before ++ [textual (key "after") (value (changeAfter c))])
   where
    name = nameText (changeSignal c)
    times = Map.findWithDefault 0 name seen :: Int
    key which = "behavior.signal." ++ name ++ (if times == 0 then "" else ' ' : show (times + 1)) ++ '.' : which
    before = [textual (key "before") (value known) | Just known <- [changeBefore c]]
  value = inertUpTo 200

-- * Attributes

attributes :: [Encoding] -> Series
attributes = pair "attributes" . list id

attribute :: String -> Series -> Encoding
attribute key value = pairs (pair "key" (text key) <> pair "value" (pairs value))

textual :: String -> String -> Encoding
textual key = attribute key . pair "stringValue" . text

-- (JSON's numbers may be read as ones of 53 bits.)
whole :: String -> Int -> Encoding
whole key = attribute key . pair "intValue" . text . show

-- | A duration in seconds. (As in all JSON of protocol buffers, what is no number there is a text.)
lasting :: String -> Seconds -> Encoding
lasting key (Seconds t) = attribute key (pair "doubleValue" value)
 where
  value
    | isNaN t = text "NaN"
    | isInfinite t = text (if t > 0 then "Infinity" else "-Infinity")
    | otherwise = number t
