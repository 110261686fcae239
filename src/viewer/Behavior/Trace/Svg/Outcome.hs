-- |
-- How the spans of a timeline ended.
module Behavior.Trace.Svg.Outcome
  ( SpanOutcome (..)
  , outcomes
  , endedBySignals
  , redone
  ) where

import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import qualified Data.IntSet as IntSet
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (catMaybes)

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Recording

-- | How a span ended.
data SpanOutcome
  = Success
  | -- | It succeeded, but what it ran in did not; and after that, something of its name ran once more.
    RanAgain
  | -- | It succeeded, because a signal ended it: see 'endedBySignals'.
    CutShort
  | Stop
  | Running
  | Failure
  | Fault
  deriving (Eq, Ord, Show, Enum, Bounded)

-- | How each span of the recording ended.
outcomes :: Recording -> Node -> SpanOutcome
outcomes r = outcome
 where
  again = ranAgain r
  ended = endedBySignals r
  outcome n = case snd <$> nodeEnd n of
    Nothing -> Running
    Just Succeeded | IntSet.member (spanNumber (nodeSpan n)) again -> RanAgain
    Just Succeeded | IntMap.member (spanNumber (nodeSpan n)) ended -> CutShort
    Just Succeeded -> Success
    Just (FailedWith _) -> Failure
    Just (FaultedWith _) -> Fault
    Just (StoppedBy _) -> Stop

-- The numbers of the spans that succeeded in a span that did not, and of whose name one began after that span's end.
ranAgain :: Recording -> IntSet.IntSet
ranAgain r = IntSet.fromList (foldr (found Nothing) [] (recordingRoots r))
 where
  found :: Maybe Seconds -> Node -> [Int] -> [Int]
  found lostAt n rest =
    [ spanNumber s
    | Just (_, Succeeded) <- [nodeEnd n]
    , Just t <- [lostAt]
    , maybe False (>= t) (Map.lookup (spanName s) lastBegin)
    ]
      ++ inner
   where
    s = nodeSpan n
    inner = foldr (found (earliest lostAt (lostBy n))) rest (nodeChildren n)
  lostBy n = case nodeEnd n of
    Just (_, Succeeded) -> Nothing
    Just (_, StoppedBy WasAbandoned) -> Nothing
    Just (t, _) -> Just t
    Nothing -> Nothing
  earliest a b = maybe b (\t -> Just (maybe t (min t) b)) a
  lastBegin = lastBegins r

-- When the last span of each name began.
lastBegins :: Recording -> Map String Seconds
lastBegins r = Map.fromListWith max [(spanName s, spanBegan s) | s <- map nodeSpan (nodes r)]

-- | The spans that succeeded because a signal changed, by their numbers, each with that reaction: it interrupted
-- what ran in the span, and after that nothing ran there but the emergency of 'Behavior.Signal.insteadWhen', from
-- which there is no way back.
endedBySignals :: Recording -> IntMap Reaction
endedBySignals r = foldr below IntMap.empty (recordingRoots r)
 where
  interrupted =
    IntMap.fromListWith
      latest
      [ (n, x)
      | x <- recordingReactions r
      , Inside n <- [reactionParent x]
      , Just b <- [reactionStopped x]
      , stoppedEnd b /= Succeeded
      ]
  latest a b = if (reactionTime a, reactionNumber a) >= (reactionTime b, reactionNumber b) then a else b
  number = spanNumber . nodeSpan
  below n known = case (nodeEnd n, catMaybes (IntMap.lookup (number n) interrupted : map byNumber (nodeChildren n))) of
    (Just (_, Succeeded), found@(_ : _))
      | x <- foldr1 latest found, all (isOver x) (nodeChildren n) -> IntMap.insert (number n) x inside
    _ -> inside
   where
    inside = foldr below known (nodeChildren n)
    byNumber c = IntMap.lookup (number c) inside
    isOver x c = case nodeEnd c of
      Just (_, StoppedBy (SignalChanged k _)) | k == reactionNumber x -> True
      Just (t, _) ->
        t <= reactionTime x || isEmergency x c || (reactionNumber <$> byNumber c) == Just (reactionNumber x)
      Nothing -> False
  isEmergency x c = reactionOperator x == "insteadWhen" && spanReaction (nodeSpan c) == Just (reactionNumber x)

-- | How much time was spent on what had to begin again: on named spans without such spans in them that failed,
-- faulted, were interrupted, or succeeded in vain, and of whose name one began after that. What lost against a part
-- beside it is not among them.
redone :: (Node -> SpanOutcome) -> Recording -> Seconds
redone outcomeOf r =
  sum
    [ t - spanBegan s
    | n <- snd (foldr leaves (False, []) (recordingRoots r))
    , let s = nodeSpan n
    , Just (t, end) <- [nodeEnd n]
    , isLost n end
    , maybe False (>= t) (Map.lookup (spanName s) begins)
    ]
 where
  begins = lastBegins r
  -- Whether there is a name, and the innermost ones.
  leaves n (there, rest) = (there || isNamed || inside, [n | isNamed, not inside] ++ rest')
   where
    isNamed = spanKind (nodeSpan n) == Named
    (inside, rest') = foldr leaves (False, rest) (nodeChildren n)
  isLost n end = case end of
    Succeeded -> outcomeOf n == RanAgain
    StoppedBy (SiblingFinished _) -> False
    StoppedBy WasAbandoned -> False
    _ -> True
