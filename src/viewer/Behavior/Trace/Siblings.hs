-- |
-- Which part finished, so that the parts beside it were stopped. A trace of names knows only in which branch of the
-- operator that was.
module Behavior.Trace.Siblings
  ( withSiblings
  ) where

import qualified Data.Map.Strict as Map

import Behavior.Trace
import Behavior.Trace.Recording

-- | With the name of the span that finished or failed in place of the name of its branch. That is the last one that
-- ended beside what was stopped, if it ended at the same time: at most a thousandth of the whole earlier.
withSiblings :: Recording -> Recording
withSiblings r = r {recordingRoots = level (recordingRoots r)}
 where
  level ns = map one ns
   where
    one n = n {nodeEnd = fmap (cause n) <$> nodeEnd n, nodeChildren = level (nodeChildren n)}
    cause n end = case (end, nodeEnd n) of
      (StoppedBy (SiblingFinished branch), Just (t, _)) -> StoppedBy (SiblingFinished (nameOr branch n t finished))
      (StoppedBy (SiblingFailed branch), Just (t, _)) -> StoppedBy (SiblingFailed (nameOr branch n t failed))
      _ -> end
    finished = lastAt [n | n <- ns, Just (_, Succeeded) <- [nodeEnd n]]
    failed = lastAt [n | n <- ns, Just (_, end) <- [nodeEnd n], isFailure end]
  nameOr branch n t known = case Map.lookupLE t known of
    Just (at, s) | at >= t - tolerance, at > spanBegan (nodeSpan n) -> spanName s
    _ -> branch
  lastAt ns = Map.fromList [(t, nodeSpan n) | n <- ns, spanKind (nodeSpan n) == Named, Just (t, _) <- [nodeEnd n]]
  isFailure (FailedWith _) = True
  isFailure (FaultedWith _) = True
  isFailure _ = False
  tolerance = (recordingUntil r - recordingFrom r) / 1000
