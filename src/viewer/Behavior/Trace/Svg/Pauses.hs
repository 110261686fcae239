{-# LANGUAGE OverloadedStrings #-}

-- |
-- The pauses of a timeline: where nothing runs in a span that has a name, although at other times something does.
-- The robot waits then, or does what has no name.
module Behavior.Trace.Svg.Pauses
  ( Pause (..)
  , pauses
  , pauseDrawn
  ) where

import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import Data.List (sortOn)
import Data.Ord (Down (..))
import qualified Data.Text as Text
import Graphics.Svg.Core (Element)

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Recording
import Behavior.Trace.Svg.Draw
import Behavior.Trace.Svg.Layout

-- | In which lane, and between which pixels; how long; and the reaction that ended it, if an operator was waiting.
data Pause = Pause
  { pauseLane :: !Int
  , pauseLeft :: !Double
  , pauseRight :: !Double
  , pauseTook :: !Seconds
  , pauseEndedBy :: !(Maybe Reaction)
  }

-- | The pauses that can be seen, given the pixel of a time.
pauses :: (Seconds -> Double) -> Recording -> [Placed] -> [Pause]
pauses x r placed = take 300 (concatMap inSpan placed)
 where
  inSpan p
    | placedBelow p || placedLane p + 1 >= maxLanes || null inner = []
    | otherwise =
        [ Pause (placedLane p + 1) (x a) (x b) (b - a) by
        | (a, b, by) <- concatMap (cut waits) (filter isWide (between begin inner end))
        , isWide (a, b)
        ]
   where
    isWide (a, b) = x b - x a >= 14
    n = placedNode p
    inner = sortOn fst [(spanBegan (nodeSpan c), nodeUntil r c) | c <- nodeChildren n]
    (begin, end) = (spanBegan (nodeSpan n), nodeUntil r n)
    waits = IntMap.findWithDefault [] (spanNumber (nodeSpan n)) waiting
  between at [] end = [(at, end) | at < end]
  between at ((a, b) : rest) end = [(at, a) | at < a] ++ between (max at b) rest end
  -- A pause ends where an operator ceased to wait.
  cut waits (a, b) = case filter (\(t, _) -> t > a && t <= b) waits of
    [] -> [(a, b, Nothing)]
    (t, by) : _ -> (a, t, Just by) : [piece | t < b, piece <- cut waits (t, b)]

  -- The reactions that ended the waiting of an operator, by what it ran in. (A monitor does not wait: its recovery
  -- has run.)
  waiting :: IntMap [(Seconds, Reaction)]
  waiting =
    IntMap.fromListWith
      (++)
      [ (n, [(reactionTime a, a)])
      | a <- sortOn (\a -> Down (reactionTime a, reactionNumber a)) (recordingReactions r)
      , reactionOperator a /= "monitor"
      , Inside n <- [reactionParent a]
      , Nothing <- [reactionStopped a]
      ]

-- | A line between those pixels, with a text in it if there is room for one. The upper edge of its lane is there, and
-- a bar has that height.
pauseDrawn :: (Double, Double) -> Double -> Double -> Pause -> [Element]
pauseDrawn (a, b) top h p = case filter ((<= b - a - 16) . wide) texts of
  text : _
    | half <- wide text / 2 + 3 ->
        [line a (middle - half), textAt "n q c" middle (top + h / 2 + 4) [("", text)], line (middle + half) b]
  [] -> [line a b]
 where
  middle = (a + b) / 2
  line left right = path "wt" (Text.concat (stroke left right)) (titled (take 1 texts))
  stroke left right = ["M", px (left + 4), " ", px (top + h / 2), "H", px (max (left + 4) (right - 4))]
  wide text = textWidth text * 11 / 12
  texts = pauseTexts p

-- What it says, the longest text first.
pauseTexts :: Pause -> [String]
pauseTexts p = case pauseEndedBy p of
  Just by -> ["waiting until " ++ changed by, "until " ++ changed by, "waiting"]
  Nothing -> [secondsText (pauseTook p)]
 where
  changed by = inertUpTo 120 (changesText [c {changeBefore = Nothing} | c <- changedOnly (reactionChanges by)])
