{-# LANGUAGE OverloadedStrings #-}

-- |
-- The title of a timeline: how it ended.
module Behavior.Trace.Svg.Header
  ( title
  , titleText
  ) where

import qualified Data.IntMap.Strict as IntMap
import Data.List (intercalate)
import Data.Maybe (isJust, maybeToList)

import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Recording
import Behavior.Trace.Svg.Draw
import Behavior.Trace.Svg.Outcome

-- | The title, no wider than that number of pixels.
title :: (Node -> SpanOutcome) -> Double -> Recording -> [Part]
title outcomeOf width r = filter (not . null . snd) [("", lead), ("tr", fitted room remarks), ("w", missing)]
 where
  (known, remarks) = heading outcomeOf r
  lead = fitted (width / 1.68 - textWidth missing) known
  missing = if recordingLost r > 0 then lostText (recordingLost r) else ""
  large text = 1.68 * textWidth text + 7
  room = (width - large lead - large missing) * 12 / 14

-- | The title without the remark about lost events.
titleText :: (Node -> SpanOutcome) -> Recording -> String
titleText outcomeOf r = unwords (filter (not . null) [lead, remarks])
 where
  (lead, remarks) = heading outcomeOf r

-- How the outermost span ended; and how often something was interrupted, what did not succeed, and how much time was
-- spent on what had to begin again.
heading :: (Node -> SpanOutcome) -> Recording -> (String, String)
heading outcomeOf r = (if null remarks then lead else lead ++ ":", intercalate ", " remarks)
 where
  (lead, parts) = case outermost r of
    Just n ->
      ( unwords [nameUpTo 60 n, ending n, "after", secondsText (nodeUntil r n - spanBegan (nodeSpan n))]
      , filter (not . same n) (nodes r)
      )
    Nothing -> (secondsText (recordingUntil r - recordingFrom r) ++ " in all", nodes r)
  remarks =
    ["interrupted " ++ times interruptions | interruptions > 0]
      ++ zipWith (\(n, how) these -> show n ++ these ++ how) counted (ofParts : repeat " ")
      ++ [secondsText again ++ " of work redone" | again > 0]
  ofParts = " of " ++ some (length parts) "part" ++ " "
  interruptions = length (filter (isJust . reactionStopped) (recordingReactions r))
  counted = [(n, how) | (o, how) <- remarked, let n = count o, n > 0]
  remarked = [(Failure, "failed"), (Fault, "faulted"), (Running, "not ended")]
  count o = length (filter ((o ==) . outcomeOf) parts)
  ending n
    | Just x <- IntMap.lookup (spanNumber (nodeSpan n)) (endedBySignals r) = "was ended by " ++ endedBy x
    | otherwise = (if outcomeOf n == Stop then "was " else "") ++ outcomeName (snd <$> nodeEnd n)
  -- The last value, and what ran in the place of what was interrupted.
  endedBy x =
    intercalate " → " $
      inertUpTo 60 (changesText [c {changeBefore = Nothing} | c <- lastOf (changedOnly (reactionChanges x))])
        : [ quotedText (inertUpTo 40 (spanName s))
          | (_, s : _) <- maybeToList (IntMap.lookup (reactionNumber x) involved)
          ]
  involved = reactionSpans r
  again = redone outcomeOf r
  lastOf = take 1 . reverse
  same a b = spanNumber (nodeSpan a) == spanNumber (nodeSpan b)

nameUpTo :: Int -> Node -> String
nameUpTo limit = inertUpTo limit . nameText . spanName . nodeSpan

-- The only span that is in no other.
outermost :: Recording -> Maybe Node
outermost r = case (filter ((Top ==) . spanParent . nodeSpan) (recordingRoots r), recordingRoots r) of
  ([n], _) -> Just n
  (_, [n]) -> Just n
  _ -> Nothing

times :: Int -> String
times 1 = "once"
times 2 = "twice"
times n = show n ++ " times"
