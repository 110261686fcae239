{-# LANGUAGE OverloadedStrings #-}

-- |
-- A recording in the trace-event format, which Perfetto, Chrome (@about:tracing@) and speedscope open.
module Behavior.Trace.TraceEvents
  ( renderTraceEvents
  ) where

import Data.Aeson.Encoding (Encoding, int, pair, pairs, unsafeToEncoding)
import Data.ByteString.Builder (char7, string7, toLazyByteString)
import qualified Data.ByteString.Lazy as Lazy
import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import Data.List (foldl', intersperse, sortOn)
import Data.Maybe (listToMaybe)
import qualified Data.Set as Set

import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Json
import Behavior.Trace.Recording

-- | The bytes of the file. A span is a complete event; one that has not ended lasts until the end
-- of the recording, and its outcome is @not ended@. A lane (a thread, for the viewers) contains only
-- spans that are one inside the other or one after the other. From a span that a reaction stopped,
-- a flow leads to each span that the reaction started. Times are relative to the beginning of the
-- recording.
--
-- The second category of a span is its outcome. Why it failed or was stopped is the name of an
-- instant event in it, at its end. A span has no arguments: speedscope makes them part of its name,
-- and adds up the times of spans by their names.
--
-- Viewers find out by times alone which spans are in which, and differ if two times are equal. So
-- each begin and end in a lane is later than the one before it, by a nanosecond if they were at the
-- same time. In a simulated run many are.
--
-- @since 0.1.0.0
renderTraceEvents :: Recording -> Lazy.ByteString
renderTraceEvents r =
  toLazyByteString $
    "{\"otherData\":" <> written (pairs (pair "lostEvents" (int (recordingLost r))))
      <> ",\"traceEvents\":[\n"
      <> mconcat (intersperse ",\n" (map event entries))
      <> char7 '\n'
      <> "]}\n"
 where
  entries = process : map laneName lanes ++ map complete spans ++ flows r spans ++ concatMap why spans
  -- Perfetto 52 shows the escapes of most texts as they are, and many texts contain an arrow.
  event = writtenExcept ">"
  spans = apart (placed r)
  lanes = Set.toList (Set.fromList (map lane spans))

-- A span in its lane. Its times are whole nanoseconds since the beginning of the recording.
data Slice = Slice
  { lane :: !Int
  , begins :: !Integer
  , ends :: !Integer
  , sliceNode :: Node
  , laidIn :: !(Maybe Int)
  -- The number of the innermost span that it is in, in its lane.
  , stoppedInside :: !Bool
  -- The reaction that stopped it stopped its parent too.
  }

-- A span, and what it is in: its parent's number and the reaction that stopped that.
data Nested = Nested
  { interval :: !(Integer, Integer)
  , nested :: !Node
  , parent :: !(Maybe Int)
  , parentStoppedBy :: !(Maybe Int)
  , position :: !Int
  -- ^ In the order in which each span comes before those in it.
  , lastInside :: !Int
  -- ^ The position of the last span in it, or its own.
  }

-- | The first one is in the second one.
isIn :: Nested -> Nested -> Bool
isIn n m = position m < position n && position n <= lastInside m

-- All spans in their lanes, in the order in which they begin. A span is in the lane of its parent,
-- unless a sibling is there at that time or the span lasts longer than its parent.
placed :: Recording -> [Slice]
placed r = reverse (placedSpans (foldl' place (Lanes 0 IntMap.empty Set.empty IntMap.empty []) ordered))
 where
  -- Of those that begin at the same time, a span comes before those in it.
  ordered = sortOn (fst . interval) (snd (foldr (within Nothing Nothing) (0, []) (recordingRoots r)))
  -- From the last span to the first: its position is the one before that of the first span in it.
  within outer stopping n (next, rest) = (here, Nested (begin, max begin end) n outer stopping here (next - 1) : inner)
   where
    (after, inner) = foldr (within (Just (spanNumber (nodeSpan n))) (stoppedBy n)) (next, rest) (nodeChildren n)
    here = after - 1
    begin = nanoseconds (spanBegan (nodeSpan n)) - start
    end = nanoseconds (nodeUntil r n) - start
  start = nanoseconds (recordingFrom r)

-- In each lane, the spans that have begun and not ended, the innermost first. And when each lane becomes free.
data Lanes = Lanes
  { laneCount :: !Int
  , open :: !(IntMap [Nested])
  , freeAt :: !(Set.Set (Integer, Int))
  , laneOf :: !(IntMap Int)
  , placedSpans :: [Slice]
  }

place :: Lanes -> Nested -> Lanes
place lanes n =
  Lanes
    { laneCount = max chosen (laneCount lanes)
    , open = IntMap.insert chosen (n : enclosing) known
    , freeAt = if null enclosing then Set.insert (end, chosen) (forget (freeAt lanes)) else freeAt lanes
    , laneOf = IntMap.insert (numberOf n) chosen (laneOf lanes)
    , placedSpans = Slice chosen begin end (nested n) (numberOf <$> listToMaybe enclosing) inside : placedSpans lanes
    }
 where
  (begin, end) = interval n
  numberOf = spanNumber . nodeSpan . nested
  inside = maybe False ((== parentStoppedBy n) . Just) (stoppedBy (nested n))
  (chosen, enclosing, known) = case parent n >>= (`IntMap.lookup` laneOf lanes) of
    Just l
      | fits here -> (l, here, open lanes)
      -- (What is over is looked at once.)
      | (l', around) <- free -> (l', around, IntMap.insert l here (open lanes))
     where
      here = dropWhile over (IntMap.findWithDefault [] l (open lanes))
    Nothing | (l, around) <- free -> (l, around, open lanes)
  free = case Set.lookupMin (freeAt lanes) of
    Just (time, l) | time <= begin -> (l, [])
    _ -> (laneCount lanes + 1, [])
  -- What begins when the span that it ran in ends is in it.
  over m = let e = snd (interval m) in e < begin || e == begin && (end > begin || not (n `isIn` m))
  -- In no other span than those that it really ran in.
  fits [] = True
  fits (m : _) = n `isIn` m && end <= snd (interval m)
  -- The lane is no longer free from when it was.
  forget = case IntMap.lookup chosen (open lanes) of
    Just around@(_ : _) -> Set.delete (snd (interval (last around)), chosen)
    _ -> id

-- | The same spans with times that tell which is in which: in each lane, no two times are equal.
apart :: [Slice] -> [Slice]
apart spans = sortOn begins (concatMap (go (-1) []) (IntMap.fromListWith (++) [(lane p, [p]) | p <- reverse spans]))
 where
  -- After the time of what was last, and inside of those that have begun and not ended.
  go time outer (p : rest) | laidIn p == fmap numberOf (listToMaybe outer) = go begin (p {begins = begin} : outer) rest
   where
    begin = max (time + 1) (begins p)
  go time (p : outer) rest = p {ends = end} : go end outer rest
   where
    end = max (time + 1) (ends p)
  go _ [] _ = []
  numberOf = spanNumber . nodeSpan . sliceNode

stoppedBy :: Node -> Maybe Int
stoppedBy n = case nodeEnd n of
  Just (_, StoppedBy (SignalChanged reaction _)) -> Just reaction
  _ -> Nothing

process :: Encoding
process =
  pairs $
    pair "ph" (text "M") <> pair "pid" (int 1) <> pair "name" (text "process_name")
      <> pair "args" (pairs (pair "name" (text "behavior")))

laneName :: Int -> Encoding
laneName l =
  pairs $
    pair "ph" (text "M") <> pair "pid" (int 1) <> pair "tid" (int l) <> pair "name" (text "thread_name")
      <> pair "args" (pairs (pair "name" (text ("lane " ++ show l))))

complete :: Slice -> Encoding
complete p =
  pairs $
    pair "ph" (text "X")
      <> pair "pid" (int 1)
      <> pair "tid" (int (lane p))
      <> pair "ts" (microseconds (begins p))
      <> pair "dur" (microseconds (ends p - begins p))
      <> pair "name" (text (nameText (spanName (nodeSpan (sliceNode p)))))
      <> pair "cat" (text (kind (spanKind (nodeSpan (sliceNode p))) ++ "," ++ outcomeName (endOf p)))
 where
  kind Named = "named"
  kind Operator = "operator"
  kind Branch = "branch"

-- In the span, just before its end: at its end, what follows hides the event.
why :: Slice -> [Encoding]
why p =
  [ pairs $
      pair "ph" (text "i")
        <> pair "s" (text "t")
        <> pair "pid" (int 1)
        <> pair "tid" (int (lane p))
        <> pair "ts" (microseconds (ends p - 1))
        <> pair "name" (text reason)
        <> pair "cat" (text "reason")
  | let reason = outcomeText (endOf p)
  , reason /= outcomeName (endOf p)
  ]

endOf :: Slice -> Maybe End
endOf = fmap snd . nodeEnd . sliceNode

-- A flow needs both of its ends, each in a span, and the first one earlier. Of the spans that a
-- reaction stopped, the outermost one is meant.
flows :: Recording -> [Slice] -> [Encoding]
flows r spans = concat (zipWith flow [1 ..] interruptions)
 where
  interruptions =
    [ (reaction, stopped, started, at)
    | (reaction, startedSpans) <- IntMap.toList startedBy
    , Just stopped <- [IntMap.lookup reaction stoppedFirst]
    , let at = leaves reaction stopped
    , started <- startedSpans
    , at <= begins started
    ]
  startedBy =
    IntMap.fromListWith (++) [(n, [p]) | p <- reverse spans, Just n <- [spanReaction (nodeSpan (sliceNode p))]]
  stoppedFirst =
    IntMap.fromListWith
      (\_ first -> first)
      [(n, p) | p <- spans, not (stoppedInside p), Just n <- [stoppedBy (sliceNode p)]]
  -- When the operator decided. A viewer looks for the span in which the flow begins; at its very end
  -- it finds none, and just before that the instant event.
  leaves n p = max (begins p) (min (ends p - 2) (IntMap.findWithDefault (ends p) n decided))
  decided =
    IntMap.fromList
      [ (reactionNumber x, nanoseconds (reactionTime x) - nanoseconds (recordingFrom r))
      | x <- recordingReactions r
      ]
  flow :: Int -> (Int, Slice, Slice, Integer) -> [Encoding]
  flow n (_, stopped, started, at) =
    [ pairs (pair "ph" (text "s") <> common n (lane stopped) at)
    , pairs (pair "ph" (text "f") <> pair "bp" (text "e") <> common n (lane started) (begins started))
    ]
  common n l at =
    pair "id" (int n)
      <> pair "pid" (int 1)
      <> pair "tid" (int l)
      <> pair "ts" (microseconds at)
      <> pair "name" (text "interruption")
      <> pair "cat" (text "interruption")

-- With all digits: a rounded end could be after that of the parent.
microseconds :: Integer -> Encoding
microseconds n = unsafeToEncoding (string7 (show whole) <> (if part == 0 then mempty else string7 ('.' : decimals)))
 where
  (whole, part) = n `divMod` 1000
  decimals = reverse (dropWhile (== '0') (reverse (replicate (3 - length (show part)) '0' ++ show part)))
