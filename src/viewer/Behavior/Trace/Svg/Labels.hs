{-# LANGUAGE OverloadedStrings #-}

-- |
-- The texts of the bars of a timeline.
module Behavior.Trace.Svg.Labels
  ( labels
  ) where

import Data.Maybe (fromMaybe, listToMaybe, mapMaybe)
import qualified Data.Text as Text
import Graphics.Svg.Core (Element)

import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Recording (Node (..))
import Behavior.Trace.Svg.Draw
import Behavior.Trace.Svg.Layout

-- | The names of the bars: in the bar, or beside it if there is room, or cut off. Below it the text of
-- its failure or fault, if there is room for that (and it is wanted). Nothing is further right than the given pixel.
labels :: Bool -> Double -> (Int -> Double) -> Double -> [Mark] -> [Element]
labels notes right y h = go (-1) 0 0
 where
  go _ _ _ [] = []
  -- The last text in this lane ends at `used`, the last one below its bars at `noted`.
  go lane used noted (m : later)
    | markLane m /= lane = go (markLane m) 0 0 (m : later)
    | otherwise = found ++ note ++ go lane used' noted' later
   where
    next = take 1 (sameLane later)
    sameLane = takeWhile ((== lane) . markLane)
    (found, used', complete) = name lane used m (maybe right markLeft (listToMaybe next))
    (note, noted')
      | notes, not complete, markOutcome m `elem` [Failure, Fault] = below lane noted m (sameLane later) (null found)
      | otherwise = ([], noted)

  name lane used m next
    | inside >= partsWidth full = at (markLeft m + 7) full True
    | isMerged m && inside < 60 = ([], max used (markRight m), False)
    | single, after >= partsWidth full = at (markRight m + 5) full True
    | inside >= partsWidth short = at (markLeft m + 7) short False
    | single, after >= partsWidth short = at (markRight m + 5) short False
    | single, next >= right, markLeft m - used - 12 >= partsWidth short = at (markLeft m - 6 - partsWidth short) short False
    | inside >= 24 = at (markLeft m + 7) [("k", fitted (inside / 1.12) (nameOf m))] False
    | otherwise = ([], max used (markRight m), False)
   where
    single = not (isMerged m) && (w >= 3 || markOutcome m == Running)
    w = markRight m - markLeft m
    inside = w - 16
    after = next - markRight m - 14
    short = [("k", nameOf m)]
    full = short ++ [("", detail) | Just detail <- [detailOf m]]
    at left parts whole =
      ( [textAt ground left (y lane + h / 2 + 4) parts]
      , max (markRight m) (left + partsWidth parts)
      , whole
      )
     where
      ground
        | left > markLeft m && left < markRight m = Text.cons 'o' (outcomeClass (markOutcome m))
        | otherwise = ""

  below lane noted m later unnamed
    | room >= min 70 (textWidth text) =
        ([textAt ("n n" <> outcomeClass (markOutcome m)) left (y lane + h + 12) [("", cut)]], left + textWidth cut + 8)
    | otherwise = ([], noted)
   where
    left = max (markLeft m) noted
    cut = fitted room text
    -- (Where a span was stopped, an arrow may be in the way.)
    room = minimum (right - 4 : mapMaybe limit later) - left
    limit o = case markOutcome o of
      Stop -> Just (markRight o - 28)
      Failure -> Just (markLeft o - 6)
      Fault -> Just (markLeft o - 6)
      _ -> Nothing
    text = inertUpTo 120 ((if unnamed then nameOf m ++ ": " else "") ++ fromMaybe "" (whyOf m))

nameOf :: Mark -> String
nameOf m
  | isMerged m, [one] <- markNames m = some (markCount m) "span" ++ ": " ++ inertUpTo 60 (nameText one)
  | isMerged m = some (markCount m) "span"
  | otherwise = nameText (spanName (nodeSpan (markNode m)))

detailOf :: Mark -> Maybe String
detailOf m
  | isMerged m = Nothing
  | otherwise = case nodeEnd (markNode m) of
      Just (t, Succeeded) -> Just (took t)
      Just (t, StoppedBy (SignalChanged _ _)) -> Just ("stopped after " ++ took t)
      Just (_, how@(StoppedBy _)) -> Just (inertUpTo 200 (howText how))
      Just _ -> whyOf m
      Nothing -> Just "not ended"
 where
  took t = secondsText (t - spanBegan (nodeSpan (markNode m)))

whyOf :: Mark -> Maybe String
whyOf m = case nodeEnd (markNode m) of
  _ | isMerged m -> Nothing
  Just (_, how) | outcomeOf (markNode m) `elem` [Failure, Fault] -> Just (inertUpTo 200 (howText how))
  _ -> Nothing
