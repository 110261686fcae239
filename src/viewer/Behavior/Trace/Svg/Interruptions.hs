{-# LANGUAGE OverloadedStrings #-}

-- |
-- The interruptions of a timeline: a marker for each change of a signal, and its arrows.
module Behavior.Trace.Svg.Interruptions
  ( InterruptionLayout
  , layInterruptions
  , interruptionsAbove
  , aboveBars
  , interruptionArrows
  , interruptionLabels
  , interruptionsBelow
  , Effect (..)
  , interruptionEffects
  , arrowSample
  , bracket
  ) where

import Data.Bifunctor (bimap)
import qualified Data.IntMap.Strict as IntMap
import Data.List (nub, nubBy, sortOn)
import Data.Maybe (isJust, listToMaybe)
import Data.Ord (Down (..))
import Data.Text (Text)
import qualified Data.Text as Text
import Graphics.Svg.Core (Element)

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Recording (Node (..), Recording (recordingReactions), reactionSpans)
import Behavior.Trace.Svg.Draw
import Behavior.Trace.Svg.Layout
import Behavior.Trace.Svg.Rows

-- | Where the interruptions are drawn.
data InterruptionLayout = InterruptionLayout
  { interruptionsAbove :: IntMap.IntMap Double
  -- ^ How much room they need above the lanes that have some ('aboveBars' is not counted).
  , interruptionArrows :: Element
  -- ^ The markers, and what leads from them.
  , interruptionLabels :: Element
  -- ^ The texts beside the markers.
  , interruptionsBelow :: [(Int, (Double, Double))]
  -- ^ In which lane, and between which pixels, arrows are directly below the bars.
  , interruptionEffects :: [Effect]
  -- ^ Of which kinds they are.
  }

-- | What a change of a signal did.
data Effect = Interrupts | OnlyStarts
  deriving (Eq, Show)

-- | Given the pixels between which they are; the height of a bar, and the space between two; where a time is, and
-- where a lane is, with what is above it; the spans; in which lane and between which pixels nothing runs that has a
-- name; the recording. Only what is drawn depends on where the lanes are.
layInterruptions
  :: Double
  -> Double
  -> (Double, Double)
  -> (Seconds -> Double)
  -> (Int -> Double)
  -> [Placed]
  -> [(Int, (Double, Double))]
  -> Recording
  -> InterruptionLayout
layInterruptions left right (barHeight, gap) x y placed pauses recorded =
  InterruptionLayout
    { interruptionsAbove = IntMap.map ((rowHeight *) . fromIntegral . rowCount) byLane
    , interruptionArrows = group (if isThin then "thin" else "") (concatMap arrows labelled)
    , interruptionLabels = group "il" (concatMap label labelled)
    , interruptionsBelow = [(placedLane from, below (ends from to)) | m <- markers, (from, to) <- pairsOf m]
    , interruptionEffects = nub (map effectOf markers)
    }
 where
  markers = map fst labelled
  labelled = concat (IntMap.elems byLane)
  byLane = IntMap.map inRows (IntMap.fromListWith (++) [(laneOf r, [(x (reactionTime r), r)]) | r <- newestFirst])
  newestFirst = sortOn (\r -> Down (reactionTime r, reactionNumber r)) shown
  inRows found@((_, r) : _) = zip ms (rowsFor left right most names ms)
   where
    (ms, most) = case map (\d -> together d (laneOf r) found) [0, 4, 8] of
      apart : near : nearer : _
        | isFew 12 apart, isFew 40 shown -> (apart, max 6 (length apart))
        | isFew 150 near -> (near, 6)
        | otherwise -> (nearer, 6)
      _ -> ([], 0)
  inRows [] = []
  rowCount rows = 1 + maximum (map (fst . snd) rows)
  rowY m row = y (markerLane m) - aboveBars - rowHeight * fromIntegral (rows - row) + 9
   where
    rows = maybe 0 rowCount (IntMap.lookup (markerLane m) byLane)
  shown = filter visible (recordingReactions recorded)
  visible r = isJust (reactionStopped r) || IntMap.member (reactionNumber r) started
  stopped = outermost [(n, p) | p <- placed, Just (_, StoppedBy (SignalChanged n _)) <- [nodeEnd (placedNode p)]]
  started = outermost [(n, p) | p <- placed, Just n <- [spanReaction (nodeSpan (placedNode p))]]
  names r =
    bimap
      (map (\s -> (spanName s, spanBegan s)))
      (fmap spanName . listToMaybe)
      (IntMap.findWithDefault ([], []) (reactionNumber r) involved)
  involved = reactionSpans recorded
  byNumber = IntMap.fromList [(spanNumber (nodeSpan (placedNode p)), p) | p <- placed]

  arrows (m, (row, _)) =
    map downTo (distinct targets) ++ map (arrow . uncurry onward) (nubBy sameLanes (pairsOf m))
   where
    targets = take 12 (concatMap (targetsOf (markerX m)) (markerReactions m))
    sameLanes (a, b) (a', b') = placedLane a == placedLane a' && placedLane b == placedLane b'
    downTo (tip, lane, further, w) =
      (if w < 8 then shape "ar" else arrow)
        (downArrow gap (max 1.5 (min 4 (w / 3))) (markerX m, rowY m row + 6) (tip, y lane + further))
    distinct = nubBy (\(_, a, _, _) (_, b, _, _) -> a == b)
  -- (Between slivers in one lane such arrows would be a tangle: each of these bars ends where the next one begins.)
  pairsOf m =
    [(from, to) | r <- markerReactions m, from : _ <- [ofMark stopped r], to : _ <- [ofMark started r], isSeen from to]
  isSeen from to = placedLane from /= placedLane to || not (any isSliver [from, to])
  isSliver p = widthOf p < 8
  -- What was stopped; else what was started; else where nothing has a name in what the operator ran in; else that. The
  -- pixel at which the arrow ends is not where two bars meet. With the width of what is there.
  targetsOf at r = case (ofMark stopped r, ofMark started r) of
    ([], []) -> case reactionParent r of
      Inside n | Just p <- IntMap.lookup n byNumber ->
        if any (isPause (placedLane p + 1) at) pauses
          then [(at, placedLane p + 1, barHeight / 2 - 2, 10)]
          else [(at, placedLane p, 0, 10)]
      _ -> []
    ([], p : _) -> [(max at (afterBegin 8 p), placedLane p, 0, widthOf p)]
    (ps, _) -> [(min at (beforeEnd 8 p), placedLane p, 0, widthOf p) | p <- ps]
  isPause lane at (lane', (a, b)) = lane == lane' && at >= a - 1 && at <= b + 1
  laneOf r = case targetsOf (x (reactionTime r)) r of
    [] -> 0
    targets -> minimum [lane | (_, lane, _, _) <- targets]
  onward from to
    | placedLane from == placedLane to = bracket (min 9 (gap - 3)) (ends from to) (y (placedLane from) + barHeight)
    | otherwise =
        onwardCurve
          (fst (ends from to), y (placedLane from) + barHeight)
          (placedLeft to, y (placedLane to) + barHeight / 2)
  arrow = if isThin then shape "ar" else arrowOver
  isThin = not (isFew 40 markers)
  isFew n = null . drop n
  below (a, b) = (min a b - 6, max a b + 6)
  ofMark known r = IntMap.findWithDefault [] (reactionNumber r) known

  label (m, (row, known)) =
    path (effectClass (effectOf m)) (diamond (markerX m) (rowY m row)) (titled about)
      : [ textAt side at (rowY m row + 4) parts
        | Just (begin, w, parts) <- [known]
        , let (side, at) = if begin < markerX m then ("e", begin + w) else ("", begin)
        ]
   where
    about = case markerReactions m of
      [r] -> [described r]
      several -> changesOf several : map (inertUpTo 100 . described) (take 2 several)
    described r = uncurry reactionText (names r) r

rowHeight :: Double
rowHeight = 20

-- | The space between the rows and the bars below them.
aboveBars :: Double
aboveBars = 14

-- (Several changes at one place are an interruption, if one of them is.)
effectOf :: Marker -> Effect
effectOf m = if any (isJust . reactionStopped) (markerReactions m) then Interrupts else OnlyStarts

effectClass :: Effect -> Text
effectClass Interrupts = "i"
effectClass OnlyStarts = "io"

-- For each reaction the spans that are in no other one of the same reaction, by lane.
outermost :: [(Int, Placed)] -> IntMap.IntMap [Placed]
outermost found = IntMap.map (sortOn placedLane . alone) (IntMap.fromListWith (++) [(n, [p]) | (n, p) <- reverse found])
 where
  alone ps = filter (not . within (IntMap.fromList [(spanNumber (nodeSpan (placedNode p)), ()) | p <- ps])) ps
  within known p = case spanParent (nodeSpan (placedNode p)) of
    Inside n -> IntMap.member n known
    _ -> False

diamond :: Double -> Double -> Text
diamond x y = Text.concat ["M", px (x - 6), " ", px y, "l6 -6 6 6-6 6Z"]

-- A line with a head at its end, over a broader one in the colour of the ground.
arrowOver :: Text -> Element
arrowOver d = group "" [shape "ha" d, shape "ar" d]

-- Straight down, and aside only at its end. Its head is that wide on each side.
downArrow :: Double -> Double -> (Double, Double) -> (Double, Double) -> Text
downArrow gap side (x, from) (tip, to)
  | abs (tip - x) < 0.5 = Text.concat ["M", px x, " ", px from, "V", px to, headTowards side 0 1]
  | otherwise = Text.concat
      ["M", px x, " ", px from, "V", px (to - bend), "L", px tip, " ", px to, headTowards side (tip - x) bend]
 where
  bend = min 10 (gap - 1)

-- The head of an arrow that goes there.
headTowards :: Double -> Double -> Double -> Text
headTowards side dx dy =
  "m" <> pair (bx - sx) (by - sy) <> "l" <> pair (sx - bx) (sy - by) <> " " <> pair (bx + sx) (by + sy)
 where
  pair a b = px a <> " " <> px b
  far = sqrt (dx * dx + dy * dy)
  (bx, by) = (-6 * dx / far, -6 * dy / far)
  (sx, sy) = (side * dy / far, -side * dx / far)

-- | From the lower edge of what was stopped to the lower edge of what was started, around where they meet.
bracket :: Double -> (Double, Double) -> Double -> Text
bracket depth (a, b) bottom =
  Text.concat ["M", px a, " ", px bottom, "v", px depth, "H", px b, "V", px bottom, headTowards 4 0 (-1)]

-- From the lower edge of what was stopped to the left edge of what was started, in another lane.
onwardCurve :: (Double, Double) -> (Double, Double) -> Text
onwardCurve (a, bottom) (left, middle) =
  Text.concat
    [ "M", px a, " ", px bottom
    , "C", px a, " ", px middle, " ", px (left - 12), " ", px middle, " ", px left, " ", px middle
    , headTowards 4 1 0
    ]

-- Where an arrow from what was stopped to what was started begins and ends: never so near to each other that
-- it cannot be seen.
ends :: Placed -> Placed -> (Double, Double)
ends from to
  | placedLane from == placedLane to, abs (b - a) < 10 = ((a + b) / 2 - 5, (a + b) / 2 + 5)
  | otherwise = (a, b)
 where
  a = beforeEnd 18 from
  b = afterBegin 18 to

widthOf :: Placed -> Double
widthOf p = placedRight p - placedLeft p

-- That many pixels before its end, after its begin; but in its last third, in its first third.
beforeEnd, afterBegin :: Double -> Placed -> Double
beforeEnd d p = placedRight p - min d (widthOf p / 3)
afterBegin d p = placedLeft p + min d (widthOf p / 3)

-- | What an arrow looks like, for the legend.
arrowSample :: Effect -> Double -> Double -> Element
arrowSample e x y =
  group "" [shape (effectClass e) (diamond (x + 5) y), shape "ar" stroke]
 where
  stroke = Text.concat ["M", px (x + 11), " ", px y, "H", px (x + 27), headTowards 4 1 0]
