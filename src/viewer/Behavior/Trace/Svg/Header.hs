{-# LANGUAGE OverloadedStrings #-}

-- |
-- The two lines at the top of a timeline: how it ended, and where most of the time went.
module Behavior.Trace.Svg.Header
  ( title
  , titleText
  , whereTimeWent
  ) where

import Data.List (inits, intercalate, sortOn)
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust)
import Data.Ord (Down (..))
import Prelude hiding (until)

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Recording
import Behavior.Trace.Svg.Draw
import Behavior.Trace.Svg.Layout

-- | The title, no wider than that number of pixels.
title :: Double -> Recording -> [Part]
title width r = filter (not . null . snd) [("", lead), ("tr", fitted ((width - large lead - large missing) * 12 / 14) remarks), ("w", missing)]
 where
  (known, remarks) = heading r
  lead = fitted (width / 1.68 - textWidth missing) known
  missing = if lost r > 0 then lostText (lost r) else ""
  large text = 1.68 * textWidth text + 7

-- | The title without the remark about lost events.
titleText :: Recording -> String
titleText r = unwords (filter (not . null) [lead, remarks])
 where
  (lead, remarks) = heading r

-- How the outermost span ended; and how often something was interrupted, and what did not succeed.
heading :: Recording -> (String, String)
heading r = (if null remarks then lead else lead ++ ":", intercalate ", " remarks)
 where
  (lead, parts) = case outermost r of
    Just n -> (unwords [nameUpTo 60 n, ending n, "after", secondsText (nodeUntil r n - spanBegan (nodeSpan n))], filter (not . same n) (nodes r))
    Nothing -> (secondsText (until r - from r) ++ " in all", nodes r)
  remarks = ["interrupted " ++ times interruptions | interruptions > 0] ++ zipWith (\(n, how) these -> show n ++ these ++ how) counted (ofParts : repeat " ")
  ofParts = (if isJust (outermost r) then " of its " else " of ") ++ some (length parts) "part" ++ " "
  interruptions = length (filter (isJust . reactionStopped) (reactions r))
  counted = [(n, how) | (o, how) <- [(Failure, "failed"), (Fault, "faulted"), (Running, "not ended")], let n = count o, n > 0]
  count o = length (filter ((o ==) . outcomeOf) parts)
  ending n = (if outcomeOf n == Stop then "was " else "") ++ outcomeName (snd <$> nodeEnd n)
  same a b = spanNumber (nodeSpan a) == spanNumber (nodeSpan b)

nameUpTo :: Int -> Node -> String
nameUpTo limit = inertUpTo limit . nameText . spanName . nodeSpan

-- The only span that is in no other.
outermost :: Recording -> Maybe Node
outermost r = case (filter ((Top ==) . spanParent . nodeSpan) (roots r), roots r) of
  ([n], _) -> Just n
  (_, [n]) -> Just n
  _ -> Nothing

times :: Int -> String
times 1 = "once"
times 2 = "twice"
times n = show n ++ " times"

-- A name, how long its spans took (counting once what they took at the same time), and its spans.
data Taken = Taken String Seconds [Node]

-- | The names that took most of the time, at the first level where it is divided: each with its time, its
-- share of the whole, and how often it ran; and how many others took at least a hundredth of it. (If none took
-- a fifth of it, the first words are others.) No wider
-- than that number of pixels.
whereTimeWent :: Double -> Recording -> [Part]
whereTimeWent width r = ("q", lead) : last (head lines' : takeWhile ((<= width) . partsWidth) lines')
 where
  lead = case listed of
    Taken _ t _ : _ : _ | t < 0.2 * total -> "spread over " ++ some (length listed) "part" ++ ", the longest:"
    _ -> "most of the time:"
  lines' = case drop 1 (inits (take 4 listed)) of
    [] -> [[("", "nothing took time")]]
    some' -> [commas (concatMap entry these) ++ others (length listed - length these) | these <- some']
  others n = [("", "and " ++ some n "other") | n > 0]
  listed = case span (\(Taken _ t _) -> t >= 0.01 * total) (mostOf r) of
    ([], rest) -> take 1 rest
    (seen, _) -> seen
  entry (Taken name t same) = [("k", inertUpTo 40 name ++ ":"), ("", secondsText t ++ remarks (share t ++ [times n | let n = length same, n > 1]))]
  remarks known = if null known then "" else " (" ++ intercalate ", " known ++ ")"
  share t =
    [ if percent < 0.5 then "under 1 %" else show (round percent :: Int) ++ " %"
    | let percent = 100 * t / total
    , percent >= 0 && percent <= 100
    ]
  total = until r - from r
  -- A comma after each but the last.
  commas (a : (c, t) : rest@(_ : _)) = a : (c, t ++ ",") : commas rest
  commas parts = parts

-- The names that took time, those that took most of it first. Where one name took nearly all of it, those in
-- its spans, and the time that they leave of it. Where there are many names that took little, those in them.
mostOf :: Recording -> [Taken]
mostOf r = level [] (roots r)
 where
  level itself ns
    | [Taken name t same] <- filter dominates (byName r ns) = level [Taken (name ++ " itself") (t - covered r (inner same)) []] (inner same)
    | sumOf here < total / 2, not (null (inner ns)), sumOf deeper > sumOf here = deeper
    | otherwise = here
   where
    here = sortOn (\(Taken _ t _) -> Down t) (filter (\(Taken _ t _) -> t > 0) (itself ++ byName r ns))
    deeper = level [] (inner ns)
  dominates (Taken _ t same) = t >= 0.9 * total && total > 0 && not (null (inner same))
  inner = concatMap nodeChildren
  sumOf taken = sum [t | Taken _ t _ <- take 4 taken]
  total = until r - from r

byName :: Recording -> [Node] -> [Taken]
byName r ns = [Taken name (covered r same) same | (name, same) <- Map.toList known]
 where
  known = Map.fromListWith (++) [(nameUpTo 200 n, [n]) | n <- reverse ns]

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
