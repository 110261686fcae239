{-# LANGUAGE OverloadedStrings #-}

-- |
-- A recording as a picture: a timeline in one SVG file.
module Behavior.Trace.Svg
  ( timeline
  ) where

import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import qualified Data.IntSet as IntSet
import Data.Maybe (fromMaybe, isJust)
import qualified Data.Text as Text
import qualified Data.Text.Lazy as Lazy
import Graphics.Svg.Core (Element)

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Recording
import Behavior.Trace.Siblings
import Behavior.Trace.Svg.Draw
import Behavior.Trace.Svg.EndsOfWaits
import Behavior.Trace.Svg.Header
import Behavior.Trace.Svg.Interruptions
import Behavior.Trace.Svg.Labels
import Behavior.Trace.Svg.Layout
import Behavior.Trace.Svg.Legend
import Behavior.Trace.Svg.Outcome
import Behavior.Trace.Svg.Pauses
import Behavior.Trace.Svg.TimeSpent

-- | The recording as an SVG file: the time from left to right, each span as a bar below the one
-- that it runs in. The colour and the right end of a bar say how it ended. An interruption is an
-- arrow from the change of the signal to what was stopped, and on to what was started. The mark of a change that
-- stopped nothing is hollow. At the top: how it ended, where most of the time went, and what the marks mean that
-- occur.
--
-- The file needs no other file and contains no script. Its text is ASCII. Spans too narrow to be
-- seen are drawn together; what failed, faulted or was stopped is always visible.
--
-- @since 0.1.0.0
timeline :: Recording -> Lazy.Text
timeline recorded =
  document
    width
    (bottom + margin)
    (titleText outcomeOf r)
    [ shape "g" (Text.concat ["M0 0H", px width, "V", px (bottom + margin), "H0Z"])
    , textAt "t" margin 34 (title outcomeOf (width - 2 * margin) r)
    , textAt "" margin 56 (whereTimeWent (width - 2 * margin) r)
    , explained
    , group "ax" (concatMap tick (ticks (fromSeconds total)))
    , group "" (map (bar (if null (drop 200 drawn) then 300 else 60) y barHeight r stopRequests) drawn)
    , group "pa" (concatMap drawnPause idle)
    , interruptionArrows interruptions
    , group "l" (concat [labelDrawn l (y (labelLane l)) | l <- texts])
    , interruptionLabels interruptions
    ]
 where
  r = endsOfWaits (withSiblings recorded)
  placed = place (\n -> (x (spanBegan (nodeSpan n)), x (nodeUntil r n))) (recordingRoots r)
  outcomeOf = outcomes r
  drawn = marks outcomeOf 800 placed
  idle = pauses x r placed
  lanes = if null placed then 1 else 1 + maximum (map placedLane placed)
  (barHeight, gap) = if lanes <= 16 then (24, 16) else (16, 7)
  interruptions = layInterruptions margin (width - 8) (barHeight, gap) x y placed pausesByLane r
  pausesByLane = [(pauseLane p, (pauseLeft p, pauseRight p)) | p <- idle]
  texts = labels (gap > 10) (width - 4) barHeight (interruptionsBelow interruptions) drawn
  (explained, further) = legend margin (width - margin) used
  axisTop = 112 + further
  used =
    Used
      { usedOutcomes = map markOutcome drawn
      , usedStopping = any (isJust . stoppingFrom stopRequests) drawn
      , usedChanges = interruptionEffects interruptions
      , usedOnward = not (null (interruptionsBelow interruptions))
      , usedPauses = not (null idle)
      , usedMerged = any isMerged drawn
      }
  -- Above a lane are the interruptions of what is in it. One with two lines of text below its bars is higher.
  y lane = fromMaybe 0 (IntMap.lookup lane tops)
  tops = IntMap.fromList (zip [0 ..] (zipWith (+) laneTops (map above [0 .. lanes])))
  laneTops = scanl (+) (axisTop + 24) (map height [0 .. lanes - 1])
  above lane = maybe 0 (+ aboveBars) (IntMap.lookup lane (interruptionsAbove interruptions))
  height lane = above lane + barHeight + gap + (if IntSet.member lane higher then 13 else 0)
  higher = IntSet.fromList [labelLane l | l <- texts, labelLinesBelow l > 1]
  bottom = y lanes
  total = recordingUntil r - recordingFrom r
  x t = margin + (width - 2 * margin) * max 0 (min 1 (share t))
  share t
    | total > 0, v <- fromSeconds (t - recordingFrom r) / fromSeconds total, not (isNaN v) = v
    | otherwise = 0
  tick (t, label) =
    [ shape "gl" (Text.concat ["M", px (pixelOf t), " ", px (axisTop + 6), "V", px bottom])
    , textAt "q c" (pixelOf t) axisTop [("", label)]
    ]
   where
    pixelOf = x . (recordingFrom r +) . realToFrac
  -- What is free of texts beside bars.
  free p =
    foldl
      without
      (pauseLeft p, pauseRight p)
      [l | l <- texts, labelLane l == pauseLane p, labelLinesBelow l == 0]
  without (a, b) l
    | labelTo l <= a || labelFrom l >= b = (a, b)
    | labelFrom l + labelTo l < a + b = (labelTo l + 2, b)
    | otherwise = (a, labelFrom l - 2)
  drawnPause p = pauseDrawn (free p) (y (pauseLane p)) barHeight p
  stopRequests = IntMap.fromList [(reactionNumber a, x (reactionTime a)) | a <- recordingReactions r]

width, margin :: Double
width = 1200
margin = 30

fromSeconds :: Seconds -> Double
fromSeconds = realToFrac

-- Round steps, about ten of them.
ticks :: Double -> [(Double, String)]
ticks total
  | total > 0, not (isInfinite total) =
      [(t, secondsText (realToFrac t)) | k <- [0 .. 20 :: Int], let t = fromIntegral k * step, t <= total * 1.0001]
  | otherwise = [(0, "0 s")]
 where
  step = head ([s | m <- [1, 2, 5, 10], let s = m * magnitude, total / s <= 12] ++ [10 * magnitude])
  magnitude = 10 ** fromIntegral (floor (logBase 10 (total / 10)) :: Int)

bar :: Int -> (Int -> Double) -> Double -> Recording -> IntMap Double -> Mark -> Element
bar limit y h r stopRequests m
  | isMerged m || w < 3 = path (Text.unwords ["m", classes]) (markShape outcome (markLeft m) top (max 1.5 w) h) about
  | otherwise = group "" (path (Text.unwords ["b", classes]) (barShape outcome (markLeft m) top w h) about : stopping)
 where
  outcome = markOutcome m
  classes =
    if isMerged m && outcome `elem` [Success, RanAgain, CutShort] && w >= 3
      then "v2 " <> outcomeClass outcome
      else outcomeClass outcome
  top = y (markLane m)
  w = markRight m - markLeft m
  about = titled $ if isMerged m then severalSpans m else aboutSpan limit r (markNode m)
  stopping = [shape "h" (barShape Stop left top (markRight m - left) h) | Just left <- [stoppingFrom stopRequests m]]

-- Where the hatched part of a bar begins, if it can be seen: the time from the request to stop until it had stopped.
stoppingFrom :: IntMap Double -> Mark -> Maybe Double
stoppingFrom stopRequests m = case nodeEnd (markNode m) of
  Just (_, StoppedBy (SignalChanged n _))
    | Just request <- IntMap.lookup n stopRequests
    , let begin = max (markLeft m) request
    , not (isMerged m) && markRight m - markLeft m >= 3 && markRight m - begin > 2 ->
        Just begin
  _ -> Nothing

severalSpans :: Mark -> [String]
severalSpans m = [some (markCount m) "span" ++ how, list (map (inertUpTo 60 . nameText) (markNames m))]
 where
  how = case markOutcome m of
    Success -> ""
    RanAgain -> ""
    CutShort -> ""
    Failure -> " failed"
    Fault -> " faulted"
    Stop -> " stopped"
    Running -> " not ended"
  list names = foldr1 (\a b -> a ++ ", " ++ b) (take 3 names) ++ (if length names > 3 then ", …" else "")

aboutSpan :: Int -> Recording -> Node -> [String]
aboutSpan limit r n =
  [ inertUpTo limit (nameText (spanName s))
  , case nodeEnd n of
      Just (t, end) -> inertUpTo (limit + 20) (endText (t - spanBegan s) end)
      Nothing -> "not ended after " ++ secondsText (recordingUntil r - spanBegan s)
  , "from " ++ secondsText (spanBegan s - recordingFrom r)
      ++ (if spanParent s == UnknownParent then ", in an unknown span" else "")
  ]
 where
  s = nodeSpan n
