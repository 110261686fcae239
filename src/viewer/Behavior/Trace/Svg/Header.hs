{-# LANGUAGE OverloadedStrings #-}

-- |
-- The title of a timeline: how it ended.
module Behavior.Trace.Svg.Header
  ( title
  , titleText
  , endedBy
  ) where

import qualified Data.IntMap.Strict as IntMap
import qualified Data.IntSet as IntSet
import Data.List (intercalate, sortOn)
import Data.Maybe (isJust, listToMaybe)
import Data.Ord (Down (..))
import Prelude hiding (until)

import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Recording
import Behavior.Trace.Svg.Draw
import Behavior.Trace.Svg.Outcome

-- | The title, no wider than that number of pixels.
title :: (Node -> Outcome) -> Double -> Recording -> [Part]
title outcomeOf width r = filter (not . null . snd) [("", lead), ("tr", fitted ((width - large lead - large missing) * 12 / 14) remarks), ("w", missing)]
 where
  (known, remarks) = heading outcomeOf r
  lead = fitted (width / 1.68 - textWidth missing) known
  missing = if lost r > 0 then lostText (lost r) else ""
  large text = 1.68 * textWidth text + 7

-- | The title without the remark about lost events.
titleText :: (Node -> Outcome) -> Recording -> String
titleText outcomeOf r = unwords (filter (not . null) [lead, remarks])
 where
  (lead, remarks) = heading outcomeOf r

-- How the outermost span ended; and how often something was interrupted, what did not succeed, and what did in vain.
heading :: (Node -> Outcome) -> Recording -> (String, String)
heading outcomeOf r = (if null remarks then lead else lead ++ ":", intercalate ", " remarks)
 where
  (lead, parts) = case outermost r of
    Just n -> (unwords [nameUpTo 60 n, ending n, "after", secondsText (nodeUntil r n - spanBegan (nodeSpan n))], filter (not . same n) (nodes r))
    Nothing -> (secondsText (until r - from r) ++ " in all", nodes r)
  remarks = ["interrupted " ++ times interruptions | interruptions > 0] ++ zipWith (\(n, how) these -> show n ++ these ++ how) counted (ofParts : repeat " ")
  ofParts = (if isJust (outermost r) then " of its " else " of ") ++ some (length parts) "part" ++ " "
  interruptions = length (filter (isJust . reactionStopped) (reactions r))
  counted = [(n, how) | (o, how) <- [(Failure, "failed"), (Fault, "faulted"), (Running, "not ended"), (RanAgain, "succeeded but ran again")], let n = count o, n > 0]
  count o = length (filter ((o ==) . outcomeOf) parts)
  ending n
    | Just by <- endedBy r = "was ended by " ++ by
    | otherwise = (if outcomeOf n == Stop then "was " else "") ++ outcomeName (snd <$> nodeEnd n)
  same a b = spanNumber (nodeSpan a) == spanNumber (nodeSpan b)

-- | The change of a signal that ended the outermost span, if that succeeded: it interrupted what ran in it, and after
-- that nothing began, and nothing else ended.
endedBy :: Recording -> Maybe String
endedBy r = case (outermost r, sortOn (Down . reactionTime) (filter (isJust . reactionStopped) (reactions r))) of
  (Just n, x : _)
    | Just (_, Succeeded) <- nodeEnd n
    , all (isOver x (around (reactionParent x))) [c | c <- nodes r, nodeSpan c /= nodeSpan n] ->
        listToMaybe [inertUpTo 60 (changesText [c {changeBefore = Nothing}]) | c <- reverse (changedOnly (reactionChanges x))]
  _ -> Nothing
 where
  isOver x outer c = case nodeEnd c of
    Just (_, StoppedBy (SignalChanged k _)) | k == reactionNumber x -> True
    Just (t, _) -> t <= reactionTime x || spanBegan (nodeSpan c) <= reactionTime x && IntSet.member (spanNumber (nodeSpan c)) outer
    Nothing -> False
  -- What the operator ran in.
  around (Inside k) | Just parent <- IntMap.lookup k parents = IntSet.insert k (around parent)
  around _ = IntSet.empty
  parents = IntMap.fromList [(spanNumber s, p) | s <- map nodeSpan (nodes r), p <- [spanParent s], p < Inside (spanNumber s)]

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
