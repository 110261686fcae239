{-# LANGUAGE OverloadedStrings #-}

-- |
-- The line below the title of a timeline: where the time went.
module Behavior.Trace.Svg.TimeSpent
  ( whereTimeWent
  ) where

import Data.Char (isDigit)
import Data.List (dropWhileEnd, intercalate, sortOn)
import qualified Data.Map.Strict as Map
import Data.Maybe (fromMaybe)
import Data.Ord (Down (..))

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Recording
import Behavior.Trace.Svg.Draw

-- A name, how long its spans took, and its spans.
data Taken = Taken String Seconds [Node]

-- | The names that took most of the time, at the first level where it is divided: each with its time, its
-- share of the whole, and how often it ran. Of the others that took at least a hundredth of it, the names; or how many
-- they are, if there is no room for that. (If none took a fifth of it, the first words are others.) No wider
-- than that number of pixels.
--
-- Where several with parts run side by side, these are the times of their parts, and the whole is the sum.
whereTimeWent :: Double -> Recording -> [Part]
whereTimeWent width r =
  ("q", lead) : last (shortest : take 1 (filter ((<= width) . partsWidth . (("q", lead) :)) texts))
 where
  (taken, total, sideBySide) = fromMaybe (mostOf r, recordingUntil r - recordingFrom r, 0) (sideBySideOf r)
  lead = case listed of
    _ | sideBySide > 0 -> show sideBySide ++ " side by side, together " ++ secondsText total ++ ":"
    Taken _ t _ : _ : _ | t < 0.2 * total -> "spread over " ++ some (length listed) "part" ++ ", the longest:"
    _ -> "time:"
  shortest = last ([("", "nothing took time")] : texts)
  texts =
    [ shown k (rest k)
    | not (null listed)
    , rest <- [namesFrom, countFrom]
    , k <- reverse [1 .. min 4 (length listed)]
    ]
  shown k rest = commas (concatMap entry (take k listed)) ++ [("", "and " ++ rest) | not (null rest)]
  namesFrom k = intercalate ", " [inertUpTo 40 name | Taken name _ _ <- drop k listed]
  countFrom k = if null (drop k listed) then "" else some (length listed - k) "other"
  listed = case span (\(Taken _ t _) -> t >= 0.01 * total) (inSeries taken) of
    ([], rest) -> take 1 rest
    (seen, _) -> seen
  entry (Taken name t same) =
    [ ("k", inertUpTo 40 name ++ ":")
    , ("", secondsText t ++ remarks (share t ++ [times n | let n = length same, n > 1, sideBySide == 0]))
    ]
  remarks known = if null known then "" else " (" ++ intercalate ", " known ++ ")"
  share t =
    [ if percent < 0.5 then "under 1 %" else show (round percent :: Int) ++ " %"
    | let percent = 100 * t / total
    , percent >= 0 && percent <= 100
    ]
  -- A comma after each but the last.
  commas (a : (c, t) : others@(_ : _)) = a : (c, t ++ ",") : commas others
  commas parts = parts

-- What is left of the time of what has parts.
unnamed :: String
unnamed = "waiting or unnamed"

times :: Int -> String
times 2 = "twice"
times n = show n ++ " times"

-- Many names: those that differ in the number at their end are one.
inSeries :: [Taken] -> [Taken]
inSeries taken
  | null (drop 4 taken) = taken
  | otherwise =
      mostFirst
        (map one (Map.toList (Map.fromListWith (++) [(numbered name, [t]) | t@(Taken name _ _) <- reverse taken])))
 where
  one (_, [single]) = single
  one ((name, _), several) =
    Taken
      (name ++ range [n | Taken n _ _ <- several])
      (sum [t | Taken _ t _ <- several])
      (concat [same | Taken _ _ same <- several])
  numbered name = let series = dropWhileEnd isDigit name in (series, series /= name)
  range names = case sortOn (\n -> (length n, n)) (map (reverse . takeWhile isDigit . reverse) names) of
    numbers@(first : _ : _) -> first ++ "–" ++ last numbers
    numbers -> concat numbers

mostFirst :: [Taken] -> [Taken]
mostFirst = sortOn (\(Taken _ t _) -> Down t)

-- The parts of those that run side by side, the sum of the times of these, and how many they are.
sideBySideOf :: Recording -> Maybe ([Taken], Seconds, Int)
sideBySideOf r = level (recordingRoots r)
 where
  level [n] = level (nodeChildren n)
  level ns
    | null (drop 1 withParts) || whole < 1.5 * covered r withParts = Nothing
    | otherwise = Just (mostFirst (filter (\(Taken _ t _) -> t > 0) (rest : known)), whole, length withParts)
   where
    withParts = filter (not . null . nodeChildren) ns
    whole = sum (map took withParts)
    known = [Taken name t same | (name, (t, same)) <- Map.toList (Map.fromListWith plus parts)]
    parts = [(name, (t, same)) | n <- withParts, Taken name t same <- byName r (nodeChildren n)]
    plus (t, a) (u, b) = (t + u, b ++ a)
    rest = Taken unnamed (whole - sum [covered r (nodeChildren n) | n <- withParts]) []
  took n = nodeUntil r n - spanBegan (nodeSpan n)

-- The names that took time, those that took most of it first. Where one name took nearly all of it, those in
-- its spans, and the time that they leave of it. Where there are many names that took little, those in them.
mostOf :: Recording -> [Taken]
mostOf r = level [] (recordingRoots r)
 where
  level itself ns
    | [Taken _ t same] <- filter dominates known =
        level [Taken unnamed (t - covered r (inner same)) []] (inner same)
    | sumOf here < total / 2, not (null (inner ns)), sumOf deeper > sumOf here = deeper
    | otherwise = here
   where
    known = byName r ns
    here = mostFirst (filter (\(Taken _ t _) -> t > 0) (itself ++ known))
    deeper = level [] (inner ns)
  dominates (Taken _ t same) = t >= 0.9 * total && total > 0 && not (null (inner same))
  inner = concatMap nodeChildren
  sumOf taken = sum [t | Taken _ t _ <- take 4 taken]
  total = recordingUntil r - recordingFrom r

byName :: Recording -> [Node] -> [Taken]
byName r ns = [Taken name (covered r same) same | (name, same) <- Map.toList known]
 where
  known = Map.fromListWith (++) [(inertUpTo 200 (nameText (spanName (nodeSpan n))), [n]) | n <- reverse ns]

-- How long at least one of them ran.
covered :: Recording -> [Node] -> Seconds
covered r ns = case sortOn fst [(spanBegan (nodeSpan n), nodeUntil r n) | n <- ns] of
  [] -> 0
  intervals@((begin, _) : _) -> go begin intervals
 where
  go _ [] = 0
  go done ((a, b) : rest)
    | b > a' = (b - a') + go b rest
    | otherwise = go done rest
   where
    a' = max a done
