-- |
-- Which reactions interrupted nothing but a wait.
module Behavior.Trace.Svg.EndsOfWaits
  ( endsOfWaits
  ) where

import qualified Data.IntMap.Strict as IntMap
import qualified Data.Map.Strict as Map

import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Recording

-- | The recording in which a reaction stopped nothing, if the branch that it stopped had named spans, all of which had
-- ended: such a branch waits (a rule that has done its work, until its condition no longer holds). Only if something
-- with a name starts, and the branch stopped at once. What a branch contains is known if a reaction started it.
endsOfWaits :: Recording -> Recording
endsOfWaits r = r {recordingReactions = map ended (recordingReactions r)}
 where
  ended x = case (reactionStopped x, IntMap.lookup (reactionNumber x) involved) of
    (Just b@StoppedBranch {stoppedEnd = StoppedBy _}, Just ([], _ : _))
      | millisecondsText (stoppingTook b) == millisecondsText 0, hadNames x b -> x {reactionStopped = Nothing}
    _ -> x
  involved = reactionSpans r
  -- A branch begins when the reaction that starts it has stopped the one before, up to a thousandth of the whole.
  hadNames x b = case Map.lookupLE (began + tolerance) =<< Map.lookup branch starting of
    Just (at, n) | at >= began - tolerance, Just (_, _ : _) <- IntMap.lookup n involved -> True
    _ -> False
   where
    began = reactionTime x - stoppedAfter b
    branch = (reactionParent x, reactionOperator x, stoppedName b)
  tolerance = (recordingUntil r - recordingFrom r) / 1000
  starting =
    Map.fromListWith
      Map.union
      [ ((reactionParent x, reactionOperator x, name), Map.singleton at (reactionNumber x))
      | x <- recordingReactions r
      , let at = reactionTime x + maybe 0 stoppingTook (reactionStopped x)
      , Just name <- [reactionStarts x]
      ]
