{-# LANGUAGE OverloadedStrings #-}

-- |
-- The markers of a timeline's interruptions, and in which row each of them and its text is.
module Behavior.Trace.Svg.Rows
  ( Marker (..)
  , Names
  , together
  , Row
  , rowsFor
  , changesOf
  ) where

import Data.List (intercalate, partition, sortOn)
import Data.Maybe (fromMaybe, isJust, isNothing, listToMaybe, mapMaybe)

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Svg.Draw

-- | Reactions whose markers would be at the same place, above that lane.
data Marker = Marker
  { markerLane :: !Int
  , markerX :: !Double
  , markerReactions :: [Reaction]
  }

-- | The names of the spans that a reaction stopped, and when each began; and the name of the first one that it
-- started.
type Names = Reaction -> ([(String, Seconds)], Maybe String)

-- | The markers above a lane: one for those that are nearer to each other than that.
together :: Double -> Int -> [(Double, Reaction)] -> [Marker]
together _ _ [] = []
together distance lane ((x, r) : rest) = Marker lane x (r : map snd near) : together distance lane far
 where
  (near, far) = span ((< x + distance) . fst) rest

-- | The row of a marker; and its text, if there is room for one: where it begins, how wide it is, and its parts.
type Row = (Int, Maybe (Double, Double, [Part]))

-- | The rows of the markers above a lane, between those pixels: at most that number of rows, and one more for
-- those that have no text. No text lies over another one, nor (if possible) over an arrow.
rowsFor :: Double -> Double -> Int -> Names -> [Marker] -> [Row]
rowsFor left right most names markers = map final chosen
 where
  -- The longest texts with which as many as possible have one; if possible, texts that say equally much.
  chosen = chosenFrom True (snd (head (sortOn fst [(without (chosenFrom False known), known) | known <- lengths])))
  lengths =
    [\m -> if isAtEdge m then texts m else take 1 (drop k (texts m)) | k <- [0 .. 2]]
      ++ [texts, drop 1 . texts, shortest]
  shortest = take 1 . reverse . texts
  without = length . filter (isNothing . snd . snd)
  final (_, (_, Nothing)) = (1 + maximum (-1 : [row | (_, (row, Just _)) <- chosen]), Nothing)
  final (_, l) = l
  chosenFrom :: Bool -> (Marker -> [[Part]]) -> [(Marker, Row)]
  chosenFrom crossing ofMarker = reverse (foldl choose [] markers)
   where
    choose done m = (m, fromMaybe (-1, Nothing) (listToMaybe fitting)) : done
     where
      fitting = mapMaybe (fits False done m) options ++ crossings
      crossings = mapMaybe (fits True done m) (if crossing then crossed else [])
      options = [(row, l) | l <- candidates (ofMarker m) m ++ shortened, row <- [0 .. most - 1]]
      shortened = if crossing then cut (ofMarker m) m else []
      crossed = [(row, l) | l <- candidates (shortest m) m, row <- [0 .. most - 1]]
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
    concat [[beside m parts | fitsRight m parts] ++ [before m parts | isAtEdge m, fitsLeft m parts] | parts <- known]
  -- A text is on the left of its marker only if there is no room on the right.
  isAtEdge m = not (any (fitsRight m) (take 1 (drop 2 (texts m))))
  fitsRight m parts = markerX m + 12 + wide parts <= right
  fitsLeft m parts = markerX m - 12 - wide parts >= left
  beside m parts = (markerX m + 12, wide parts, parts)
  before m parts = (markerX m - 12 - wide parts, wide parts, parts)
  wide = partsWidth
  cut ((part : _) : _) m
    | room <- right - markerX m - 24, room > 90 = [(markerX m + 12, room, [("k", fitted (room / 1.12) (snd part))])]
  cut _ _ = []
  texts m = case markerReactions m of
    [r] ->
      [[("k", changed), ("q", what)] | (changed, what) <- variants r, not (null what)]
        ++ [[("k", known)] | known <- [values r, briefly r]]
    several
      | null (drop 40 markers), (r : others) <- interruptionsFirst several ->
          [[("k", known), ("q", "and " ++ changesOf others)] | known <- [values r, briefly r]]
      | otherwise -> []
  variants r =
    [ (values r, inertUpTo 160 (long r))
    , (values r, inertUpTo 80 (arrows (short r)))
    , (briefly r, inertUpTo 80 (arrows (short r)))
    , (briefly r, inertUpTo 80 (arrows (take 1 (short r))))
    , (briefly r, inertUpTo 80 (arrows (startsText (snd (names r)) r)))
    ]
  interruptionsFirst = uncurry (++) . partition (isJust . reactionStopped)
  values r = inertUpTo 120 (intercalate " → " (fst (partsOf r {reactionChanges = shownChanges r})))
  shownChanges r = map withoutOpposite (changedOnly (reactionChanges r))
  -- (What a condition was before follows from what it is.)
  withoutOpposite c = if changeAfter c `elem` ["True", "False"] then c {changeBefore = Nothing} else c
  -- Without the values before.
  briefly r = values r {reactionChanges = [c {changeBefore = Nothing} | c <- changedOnly (reactionChanges r)]}
  partsOf r = uncurry reactionParts (names r) r
  long r = arrows (snd (partsOf r))
  short r = [stoppedText (map fst (fst (names r))) b | Just b <- [reactionStopped r]] ++ startsText (snd (names r)) r
  arrows = unwords . map ("→ " ++)

-- | How many of them interrupted something, and how many only started something.
changesOf :: [Reaction] -> String
changesOf rs =
  intercalate
    ", "
    [some n what | (n, what) <- [(interruptions, "interruption"), (length rs - interruptions, "start")], n > 0]
 where
  interruptions = length (filter (isJust . reactionStopped) rs)
