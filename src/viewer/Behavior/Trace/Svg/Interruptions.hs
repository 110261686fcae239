{-# LANGUAGE OverloadedStrings #-}

-- |
-- The interruptions of a timeline: a marker for each change of a signal, and its arrows.
module Behavior.Trace.Svg.Interruptions
  ( Interruptions
  , layInterruptions
  , interruptionsBottom
  , interruptionArrows
  , interruptionLabels
  , arrowSample
  ) where

import Data.Bifunctor (bimap)
import qualified Data.IntMap.Strict as IntMap
import Data.List (intercalate, nubBy, sortOn)
import Data.Maybe (fromMaybe, isJust, isNothing, listToMaybe, mapMaybe)
import Data.Text (Text)
import qualified Data.Text as Text
import Graphics.Svg.Core (Element)

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Recording (Node (..), Recording (reactions), reactionSpans)
import Behavior.Trace.Svg.Draw
import Behavior.Trace.Svg.Layout

-- | Where the interruptions are drawn.
data Interruptions = Interruptions
  { interruptionsBottom :: !Double
  -- ^ The lower end of their labels, where the lanes may begin.
  , interruptionArrows :: Element
  , interruptionLabels :: Element
  }

-- Reactions whose markers would be at the same place.
data Marker = Marker
  { markerX :: !Double
  , markerReactions :: [Reaction]
  }

-- Its row, and the label if there is room for one: where it begins, how wide it is, and its parts.
type Label = (Int, Maybe (Double, Double, [Part]))

-- | Given the pixels between which they are, and where the rows of their labels begin; the height
-- of a bar; where a time and where a lane is; the spans; the recording.
layInterruptions
  :: Double -> Double -> Double -> Double -> (Seconds -> Double) -> (Int -> Double) -> [Placed] -> Recording -> Interruptions
layInterruptions left right top barHeight x y placed recorded =
  Interruptions
    { interruptionsBottom = top + rowHeight * fromIntegral rows
    , interruptionArrows = group (if isThin then "thin" else "") (concatMap arrows labelled)
    , interruptionLabels = group "il" (concatMap label labelled)
    }
 where
  markers = case together 4 found of
    ms | length ms > 150 -> together 8 found
    ms -> ms
  found = sortOn fst [(x (reactionTime r), r) | r <- reactions recorded, visible r]
  visible r = isJust (reactionStopped r) || IntMap.member (reactionNumber r) started
  labelled = zip markers (rowsFor left right names markers)
  rows = if null markers then 0 else 1 + maximum (map (fst . snd) labelled)
  rowY row = top + rowHeight * fromIntegral row + 9
  stopped = outermost [(n, p) | p <- placed, Just (_, StoppedBy (SignalChanged n _)) <- [nodeEnd (placedNode p)]]
  started = outermost [(n, p) | p <- placed, Just n <- [spanReaction (nodeSpan (placedNode p))]]
  names r = bimap (map (\s -> (spanName s, spanBegan s))) (fmap spanName . listToMaybe) (IntMap.findWithDefault ([], []) (reactionNumber r) involved)
  involved = reactionSpans recorded
  byNumber = IntMap.fromList [(spanNumber (nodeSpan (placedNode p)), p) | p <- placed]

  arrows (m, (row, _)) =
    map (arrow . downTo) (distinct targets) ++ map (arrow . uncurry onward) (nubBy sameLanes pairs)
   where
    targets = take 12 (concatMap targetsOf (markerReactions m))
    pairs = [(from, to) | r <- markerReactions m, from : _ <- [find' stopped r], to : _ <- [find' started r]]
    sameLanes (a, b) (a', b') = placedLane a == placedLane a' && placedLane b == placedLane b'
    downTo p = verticalArrow (markerX m) (rowY row + 6) (y (placedLane p))
    distinct = nubBy (\a b -> placedLane a == placedLane b)
  -- What was stopped; else what was started; else where the operator ran.
  targetsOf r = case (find' stopped r, find' started r) of
    ([], []) -> case reactionParent r of
      Inside n -> maybe [] pure (IntMap.lookup n byNumber)
      _ -> []
    ([], p : _) -> [p]
    (ps, _) -> ps
  onward from to = onwardArrow barHeight (box from) (box to)
  arrow = if isThin then shape "ar" else arrowOver
  isThin = length markers > 40
  find' known r = IntMap.findWithDefault [] (reactionNumber r) known
  box p = (placedLeft p, placedRight p, y (placedLane p))

  label (m, (row, known)) =
    path "i" (diamond (markerX m) (rowY row)) (titled about)
      : maybe [] (\(at, _, parts) -> [textAt "" at (rowY row + 4) parts]) known
   where
    about = case markerReactions m of
      [r] -> [described r]
      several -> some (length several) "interruption" : map (inertUpTo 100 . described) (take 2 several)
    described r = uncurry reactionText (names r) r

rowHeight :: Double
rowHeight = 20

-- For each reaction the spans that are in no other one of the same reaction, by lane.
outermost :: [(Int, Placed)] -> IntMap.IntMap [Placed]
outermost found = IntMap.map (sortOn placedLane . alone) (IntMap.fromListWith (++) [(n, [p]) | (n, p) <- reverse found])
 where
  alone ps = filter (not . within (IntMap.fromList [(spanNumber (nodeSpan (placedNode p)), ()) | p <- ps])) ps
  within known p = case spanParent (nodeSpan (placedNode p)) of
    Inside n -> IntMap.member n known
    _ -> False

together :: Double -> [(Double, Reaction)] -> [Marker]
together _ [] = []
together distance ((x, r) : rest) = Marker x (r : map snd near) : together distance far
 where
  (near, far) = span ((< x + distance) . fst) rest

-- The rows of the markers, so that no label lies over another one, nor (if possible) over an
-- arrow. The last row
-- is for those that have no label. (Given the names of the spans that a reaction stopped, and when each
-- began; and the name of the first one that it started.)
rowsFor :: Double -> Double -> (Reaction -> ([(String, Seconds)], Maybe String)) -> [Marker] -> [Label]
rowsFor left right names markers = map final chosen
 where
  -- The longest texts with which as many as possible have one.
  chosen = chosenFrom True (snd (head (sortOn fst [(without (chosenFrom False known), known) | known <- lengths])))
  lengths = [texts, drop 1 . texts, drop 2 . texts]
  without = length . filter (isNothing . snd . snd)
  final (_, (_, Nothing)) = (1 + maximum (-1 : [row | (_, (row, Just _)) <- chosen]), Nothing)
  final (_, l) = l
  chosenFrom :: Bool -> (Marker -> [[Part]]) -> [(Marker, Label)]
  chosenFrom crossing ofMarker = reverse (foldl choose [] markers)
   where
    choose done m = (m, fromMaybe (-1, Nothing) (listToMaybe (mapMaybe (fits False done m) options ++ mapMaybe (fits True done m) (if crossing then shortest else [])))) : done
     where
      options = [(row, l) | l <- candidates (ofMarker m) m, row <- [0 .. 5]]
      shortest = [(row, l) | l <- candidates (drop 2 (texts m)) m, row <- [0 .. 5]]
  -- Better an arrow behind a label than no label.
  fits crossed done m (row, l@(at, w, _))
    | any conflict (take 200 done) = Nothing
    | otherwise = Just (row, Just l)
   where
    conflict (_, (_, Nothing)) = False
    conflict (other, (row', Just (at', w', _)))
      | row == row' = at - 14 < at' + w' + 14 && at' - 14 < at + w + 14
      | crossed = False
      | row < row' = covers at' w' (markerX m)
      | otherwise = covers at w (markerX other)
  covers at w x = x > at - 8 && x < at + w + 8
  candidates known m =
    concat [[beside m parts | fitsRight m parts] ++ [before m parts | fitsLeft m parts] | parts <- known] ++ cut known m
  fitsRight m parts = markerX m + 12 + wide parts <= right
  fitsLeft m parts = markerX m - 12 - wide parts >= left
  beside m parts = (markerX m + 12, wide parts, parts)
  before m parts = (markerX m - 12 - wide parts, wide parts, parts)
  wide = partsWidth
  cut ((part : _) : _) m
    | room <- right - markerX m - 24, room > 90 = [(markerX m + 12, room, [("k", fitted (room / 1.12) (snd part))])]
  cut _ _ = []
  texts m = case markerReactions m of
    [r] -> [[("k", changesOf r), ("q", inertUpTo 160 (long r))], [("k", changesOf r), ("q", inertUpTo 80 (short r))], [("k", changesOf r)]]
    several
      | null (drop 40 markers) -> replicate 3 [("k", some (length several) "interruption")]
      | otherwise -> []
  changesOf r = inertUpTo 120 (intercalate " → " (fst (partsOf r)))
  partsOf r = uncurry reactionParts (names r) r
  long r = arrows (snd (partsOf r))
  short r = arrows (foldMap (pure . stoppedText (map fst (fst (names r)))) (reactionStopped r) ++ startsText (snd (names r)) r)
  arrows = unwords . map ("→ " ++)

diamond :: Double -> Double -> Text
diamond x y = Text.concat ["M", px (x - 6), " ", px y, "l6 -6 6 6-6 6Z"]

-- A line with a head at its end, over a broader one in the colour of the ground.
arrowOver :: Text -> Element
arrowOver d = group "" [shape "ha" d, shape "ar" d]

verticalArrow :: Double -> Double -> Double -> Text
verticalArrow x from to = Text.concat ["M", px x, " ", px from, "V", px to, "m-4 -6l4 6 4-6"]

-- From the lower edge of what was stopped, where it ends, to where the other one begins: from below
-- if that is in the same lane, else from the left.
onwardArrow :: Double -> (Double, Double, Double) -> (Double, Double, Double) -> Text
onwardArrow h (left, right, y) (left', right', y')
  | y == y' = curve (b, y + h + 12) (b, y + h) "m-4 5l4 -5 4 5"
  | otherwise = curve (left' - 12, y' + h / 2) (left', y' + h / 2) "m-6 -4l6 4-6 4"
 where
  curve (cx, cy) (x, to) end =
    Text.concat ["M", px a, " ", px (y + h), "C", px a, " ", px cy, " ", px cx, " ", px cy, " ", px x, " ", px to, end]
  -- (Never so near to each other that the arrow cannot be seen.)
  (a, b) = if abs (b' - a') < 10 && y == y' then ((a' + b') / 2 - 5, (a' + b') / 2 + 5) else (a', b')
  a' = max (left + (right - left) / 2) (right - 8)
  b' = min (left' + (right' - left') / 2) (left' + 10)

-- | What an arrow looks like, for the legend.
arrowSample :: Double -> Double -> Element
arrowSample x y =
  group "" [shape "i" (diamond (x + 5) y), shape "ar" (Text.concat ["M", px (x + 11), " ", px y, "H", px (x + 27), "m-5 -4l5 4-5 4"])]
