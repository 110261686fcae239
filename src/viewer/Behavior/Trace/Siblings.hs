-- |
-- Which part finished, or which wait ended, so that the parts beside it were stopped. A trace of names knows only in
-- which branch of the operator that was.
module Behavior.Trace.Siblings
  ( withSiblings
  ) where

import qualified Data.IntMap.Strict as IntMap
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Recording

-- | With the name of the span that finished or failed in place of the name of its branch. That is the last one that
-- ended beside what was stopped, if it ended at the same time: at most a thousandth of the whole earlier. If none
-- finished then, but one wait for a signal ended, and no other, that signal is the cause. Spans inside of what was
-- stopped have its cause, if they ended after that.
withSiblings :: Recording -> Recording
withSiblings r = r {recordingRoots = roots, recordingReactions = map stopping (recordingReactions r)}
 where
  roots = level Nothing (recordingRoots r)
  -- The first argument: how the span around ended, in the trace and as it is shown, and when the cause of that was.
  level around ns = map one ns
   where
    one n = case nodeEnd n of
      Just (t, end)
        | Just (at, shown) <- causeOf n t end ->
            n {nodeEnd = Just (t, StoppedBy shown), nodeChildren = level (Just (end, shown, at)) (nodeChildren n)}
      _ -> n {nodeChildren = level Nothing (nodeChildren n)}
    causeOf n t end = case end of
      StoppedBy (SiblingFinished _)
        | Just ((at, _), s) <- lastOf finished -> Just (at, SiblingFinished (spanName s))
        | Just (key@(at, _), x) <- lastOf waits, Nothing <- before key waits ->
            Just (at, SignalChanged (reactionNumber x) (reactionChanges x))
      StoppedBy (SiblingFailed _) | Just ((at, _), s) <- lastOf failed -> Just (at, SiblingFailed (spanName s))
      _ | Just (same, shown, at) <- around, same == end, t >= at -> Just (at, shown)
      _ -> Nothing
     where
      lastOf = inTime . Map.lookupLE (t, maxBound)
      before at = inTime . Map.lookupLT at
      inTime found = case found of
        Just ((at, _), _) | at < t - tolerance || at <= spanBegan (nodeSpan n) -> Nothing
        _ -> found
      waits = Map.findWithDefault Map.empty (spanParent (nodeSpan n)) endedWaits
    finished = byEnd [n | n <- ns, Just (_, Succeeded) <- [nodeEnd n]]
    failed = byEnd [n | n <- ns, Just (_, end) <- [nodeEnd n], isFailure end]
  byEnd ns =
    Map.fromList
      [((t, spanNumber s), s) | n <- ns, s <- [nodeSpan n], spanKind s == Named, Just (t, _) <- [nodeEnd n]]
  isFailure (FailedWith _) = True
  isFailure (FaultedWith _) = True
  isFailure _ = False
  tolerance = (recordingUntil r - recordingFrom r) / 1000

  -- By what they ran in.
  endedWaits :: Map Parent (Map (Seconds, Int) Reaction)
  endedWaits =
    Map.fromListWith
      Map.union
      [ (reactionParent x, Map.singleton (reactionTime x, reactionNumber x) x)
      | x <- recordingReactions r
      , isEndedWait x
      , not (null (reactionChanges x))
      ]
  isEndedWait x = reactionOperator x `elem` ["waitUntil", "waitUntilJust"]

  -- With the outermost span that was stopped because the wait ended.
  stopping x = case IntMap.lookup (reactionNumber x) stopped of
    Just n | isEndedWait x, Just (t, end) <- nodeEnd n -> x {reactionStopped = Just (branch (reactionTime x) n t end)}
    _ -> x
  branch asked n t =
    StoppedBranch (spanName (nodeSpan n)) (max 0 (asked - spanBegan (nodeSpan n))) (max 0 (t - asked))
  stopped =
    IntMap.fromListWith
      (\_ outer -> outer)
      [(k, n) | n <- foldr below [] roots, Just (_, StoppedBy (SignalChanged k _)) <- [nodeEnd n]]
  below n rest = n : foldr below rest (nodeChildren n)
