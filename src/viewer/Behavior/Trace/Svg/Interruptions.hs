{-# LANGUAGE OverloadedStrings #-}

-- |
-- The interruptions of a timeline: a marker for each change of a signal, and its arrows.
module Behavior.Trace.Svg.Interruptions
  ( Interruptions
  , layInterruptions
  , interruptionsBottom
  , interruptionArrows
  , interruptionLabels
  , interruptionsBelow
  , Effect (..)
  , interruptionEffects
  , arrowSample
  ) where

import Data.Bifunctor (bimap)
import qualified Data.IntMap.Strict as IntMap
import Data.List (intercalate, nub, nubBy, sortOn)
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

-- Reactions whose markers would be at the same place.
data Marker = Marker
  { markerX :: !Double
  , markerReactions :: [Reaction]
  }

-- Its row, and the label if there is room for one: where it begins, how wide it is, and its parts.
type Label = (Int, Maybe (Double, Double, [Part]))

-- | Given the pixels between which they are, and where the rows of their labels begin; the height
-- of a bar, and the space between two; where a time and where a lane is; the spans; the recording. Only the arrows
-- depend on where the lanes are.
layInterruptions
  :: Double -> Double -> Double -> (Double, Double) -> (Seconds -> Double) -> (Int -> Double) -> [Placed] -> Recording -> Interruptions
layInterruptions left right top (barHeight, gap) x y placed recorded =
  Interruptions
    { interruptionsBottom = top + rowHeight * fromIntegral rows
    , interruptionArrows = group (if isThin then "thin" else "") (concatMap arrows labelled)
    , interruptionLabels = group "il" (concatMap label labelled)
    , interruptionsBelow = [(placedLane from, below (ends from to)) | m <- markers, (from, to) <- pairsOf m]
    , interruptionEffects = nub (map effectOf markers)
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
    map (arrow . downTo) (distinct targets) ++ map (arrow . uncurry onward) (nubBy sameLanes (pairsOf m))
   where
    targets = take 12 (concatMap (targetsOf (markerX m)) (markerReactions m))
    sameLanes (a, b) (a', b') = placedLane a == placedLane a' && placedLane b == placedLane b'
    downTo (tip, p) = downArrow gap (markerX m, rowY row + 6) (tip, y (placedLane p))
    distinct = nubBy (\a b -> placedLane (snd a) == placedLane (snd b))
  pairsOf m = [(from, to) | r <- markerReactions m, from : _ <- [find' stopped r], to : _ <- [find' started r]]
  -- What was stopped; else what was started; else where the operator ran. And the pixel at which the arrow ends: not
  -- where two bars meet.
  targetsOf at r = case (find' stopped r, find' started r) of
    ([], []) -> case reactionParent r of
      Inside n -> maybe [] (\p -> [(at, p)]) (IntMap.lookup n byNumber)
      _ -> []
    ([], p : _) -> [(max at (afterBegin 8 p), p)]
    (ps, _) -> [(min at (beforeEnd 8 p), p) | p <- ps]
  onward from to
    | placedLane from == placedLane to = bracket (min 9 (gap - 3)) (ends from to) (y (placedLane from) + barHeight)
    | otherwise = onwardCurve (fst (ends from to), y (placedLane from) + barHeight) (placedLeft to, y (placedLane to) + barHeight / 2)
  arrow = if isThin then shape "ar" else arrowOver
  isThin = length markers > 40
  below (a, b) = (min a b - 6, max a b + 6)
  find' known r = IntMap.findWithDefault [] (reactionNumber r) known

  label (m, (row, known)) =
    path (effectClass (effectOf m)) (diamond (markerX m) (rowY row)) (titled about)
      : maybe [] (\(at, _, parts) -> [textAt "" at (rowY row + 4) parts]) known
   where
    about = case markerReactions m of
      [r] -> [described r]
      several -> changesOf several : map (inertUpTo 100 . described) (take 2 several)
    described r = uncurry reactionText (names r) r

rowHeight :: Double
rowHeight = 20

-- (Several changes at one place are an interruption, if one of them is.)
effectOf :: Marker -> Effect
effectOf m = if any (isJust . reactionStopped) (markerReactions m) then Interrupts else OnlyStarts

effectClass :: Effect -> Text
effectClass Interrupts = "i"
effectClass OnlyStarts = "io"

-- How many of them interrupted something, and how many only started something.
changesOf :: [Reaction] -> String
changesOf rs = intercalate ", " [some n what | (n, what) <- [(interruptions, "interruption"), (length rs - interruptions, "start")], n > 0]
 where
  interruptions = length (filter (isJust . reactionStopped) rs)

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
  lengths = [texts, drop 1 . texts, shortest]
  shortest = take 1 . reverse . texts
  without = length . filter (isNothing . snd . snd)
  final (_, (_, Nothing)) = (1 + maximum (-1 : [row | (_, (row, Just _)) <- chosen]), Nothing)
  final (_, l) = l
  chosenFrom :: Bool -> (Marker -> [[Part]]) -> [(Marker, Label)]
  chosenFrom crossing ofMarker = reverse (foldl choose [] markers)
   where
    choose done m = (m, fromMaybe (-1, Nothing) (listToMaybe (mapMaybe (fits False done m) options ++ mapMaybe (fits True done m) (if crossing then crossed else [])))) : done
     where
      options = [(row, l) | l <- candidates (ofMarker m) m, row <- [0 .. 5]]
      crossed = [(row, l) | l <- candidates (shortest m) m, row <- [0 .. 5]]
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
    [r] -> [[("k", changed), ("q", what)] | (changed, what) <- variants r, not (null what)] ++ [[("k", values r)]]
    several
      | null (drop 40 markers) -> [[("k", changesOf several)]]
      | otherwise -> []
  variants r =
    [ (values r, inertUpTo 160 (long r))
    , (values r, inertUpTo 80 (arrows (short r)))
    , (briefly r, inertUpTo 80 (arrows (short r)))
    , (briefly r, inertUpTo 80 (arrows (take 1 (short r))))
    ]
  values r = inertUpTo 120 (intercalate " → " (fst (partsOf r)))
  -- Without the values before.
  briefly r = values r {reactionChanges = [c {changeBefore = Nothing} | c <- reactionChanges r]}
  partsOf r = uncurry reactionParts (names r) r
  long r = arrows (snd (partsOf r))
  short r = [stoppedText (map fst (fst (names r))) b | Just b <- [reactionStopped r]] ++ startsText (snd (names r)) r
  arrows = unwords . map ("→ " ++)

diamond :: Double -> Double -> Text
diamond x y = Text.concat ["M", px (x - 6), " ", px y, "l6 -6 6 6-6 6Z"]

-- A line with a head at its end, over a broader one in the colour of the ground.
arrowOver :: Text -> Element
arrowOver d = group "" [shape "ha" d, shape "ar" d]

-- Straight down, and aside only at its end.
downArrow :: Double -> (Double, Double) -> (Double, Double) -> Text
downArrow gap (x, from) (tip, to)
  | abs (tip - x) < 0.5 = Text.concat ["M", px x, " ", px from, "V", px to, headTowards 0 1]
  | otherwise = Text.concat ["M", px x, " ", px from, "V", px (to - bend), "L", px tip, " ", px to, headTowards (tip - x) bend]
 where
  bend = min 10 (gap - 1)

-- The head of an arrow that goes there.
headTowards :: Double -> Double -> Text
headTowards dx dy = "m" <> pair (bx - sx) (by - sy) <> "l" <> pair (sx - bx) (sy - by) <> " " <> pair (bx + sx) (by + sy)
 where
  pair a b = px a <> " " <> px b
  far = sqrt (dx * dx + dy * dy)
  (bx, by) = (-6 * dx / far, -6 * dy / far)
  (sx, sy) = (4 * dy / far, -4 * dx / far)

-- From the lower edge of what was stopped to the lower edge of what was started, around where they meet.
bracket :: Double -> (Double, Double) -> Double -> Text
bracket depth (a, b) bottom =
  Text.concat ["M", px a, " ", px bottom, "v", px depth, "H", px b, "V", px bottom, headTowards 0 (-1)]

-- From the lower edge of what was stopped to the left edge of what was started, in another lane.
onwardCurve :: (Double, Double) -> (Double, Double) -> Text
onwardCurve (a, bottom) (left, middle) =
  Text.concat ["M", px a, " ", px bottom, "C", px a, " ", px middle, " ", px (left - 12), " ", px middle, " ", px left, " ", px middle, headTowards 1 0]

-- Where an arrow from what was stopped to what was started begins and ends: never so near to each other that
-- it cannot be seen.
ends :: Placed -> Placed -> (Double, Double)
ends from to
  | placedLane from == placedLane to, abs (b - a) < 10 = ((a + b) / 2 - 5, (a + b) / 2 + 5)
  | otherwise = (a, b)
 where
  a = beforeEnd 18 from
  b = afterBegin 18 to

-- That many pixels before its end, after its begin; but in its last third, in its first third.
beforeEnd, afterBegin :: Double -> Placed -> Double
beforeEnd d p = placedRight p - min d ((placedRight p - placedLeft p) / 3)
afterBegin d p = placedLeft p + min d ((placedRight p - placedLeft p) / 3)

-- | What an arrow looks like, for the legend.
arrowSample :: Effect -> Double -> Double -> Element
arrowSample e x y =
  group "" [shape (effectClass e) (diamond (x + 5) y), shape "ar" (Text.concat ["M", px (x + 11), " ", px y, "H", px (x + 27), headTowards 1 0])]
