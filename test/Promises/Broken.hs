-- |
-- Languages in which one operator is broken, each by a hazard that somebody ran into.
-- Every one must be rejected by a promise.
module Promises.Broken
  ( Mutant (..)
  , mutants
  , copy
  ) where

import Promises.Copy
import Promises.Language
import Promises.Properties
import Promises.Stage (Promise)

-- | A language with one operator that is wrong.
data Mutant = Mutant
  { what :: String
  -- ^ Which operator, and what is wrong with it.
  , breaks :: Promise
  -- ^ A promise that it does not keep. (There may be others.)
  , spoken :: Language
  }

-- | The copy that has no flaw: it must keep every promise.
copy :: Language
copy = copied Nothing

mutants :: [Mutant]
mutants =
  [ Mutant "parallel returns while the loser still cleans up" structure sound {parallel = parallel (by ReturnsBeforeTheLoser)}
  , Mutant "scoped returns while what it forked still cleans up" structure sound {beside = beside (by ReturnsBeforeTheLoser)}
  , Mutant "firstOf leaves its branches alone when its caller is cancelled a second time" structure sound {firstOf = firstOf (by OrphansAtSecondCancel)}
  , Mutant "allOf asks again, and so interrupts a cleanup, at a second cancellation" structure sound {allOf = allOf (by AsksTwice)}
  , Mutant "? swallows a cancellation" heard sound {fallback = fallback (by SwallowsCancellation)}
  , Mutant "attempt swallows a cancellation" heard sound {attempt = attempt (by SwallowsCancellation)}
  , Mutant "monitor takes what is thrown at its caller for its sensor's" causes sound {monitor = monitor (by TakesWhatIsThrownForItsOwn)}
  , Mutant "parallel goes on when something of a synchronous type is thrown at its caller" noLostFault sound {parallel = parallel (by TakesWhatIsThrownForItsOwn)}
  , Mutant "failingOn takes a cancellation for a fault" heard sound {failing = failing (by FailsWhenCancelled)}
  , Mutant "the second of ? runs in an exception handler, masked" unmasked sound {fallback = fallback (by RecoversInAHandler)}
  , Mutant "branches of both inherit the caller's masking state" unmasked sound {both = both (by InheritsMasking)}
  , Mutant "a branch of firstOf that is killed before its handler is in place says nothing" structure sound {firstOf = firstOf (by PublishesByAHandler)}
  , Mutant "parallel stops one branch after the other" together sound {parallel = parallel (by StopsOneByOne)}
  , Mutant "in firstOf the right one wins a tie" firstThenLeft sound {firstOf = firstOf (by RightWinsTies)}
  , Mutant "both waits for the left one before it looks at the right one" firstThenLeft sound {both = both (by WaitsFromLeftToRight)}
  , Mutant "parallel drops a fault in the loser's cleanup" noLostFault sound {parallel = parallel (by DropsTheLosersFault)}
  , Mutant "allOf throws the rightmost fault" noLostFault sound {allOf = allOf (by ThrowsTheRightmostFault)}
  , Mutant "both throws the fault of a cleanup in place of the cancellation" causes sound {both = both (by HidesCancellationByAFault)}
  , Mutant "rSelect starts the other branch before this one has ended" neverBoth sound {rSelect = rSelect (by StartsBeforeTheEnd)}
  , Mutant "monitor starts the recovery before the task has ended" neverBoth sound {monitor = monitor (by StartsBeforeTheEnd)}
  , Mutant "rSelect goes on although the branch completed when asked to stop" noLostWork sound {rSelect = rSelect (by RunsTheCompletedAgain)}
  , Mutant "monitor runs a task again that completed when asked to stop" noLostWork sound {monitor = monitor (by RunsTheCompletedAgain)}
  , Mutant "timeout drops a result that came when time was up" noLostWork sound {timeout = timeout (by DropsWhatCompletedInTime)}
  , Mutant "rSelect starts what the condition said before the branch was stopped" readAfresh sound {rSelect = rSelect (by DoesNotReadAgain)}
  , Mutant "monitor lets the recovery go when the condition has changed its mind" latchedRecovery sound {monitor = monitor (by ReadsAgainBeforeTheRecovery)}
  , Mutant "monitor watches the condition while the recovery runs" latchedRecovery sound {monitor = monitor (by WatchesDuringTheRecovery)}
  , Mutant "monitor throws what a cleanup threw, and the recovery does not run" latchedRecovery sound {monitor = monitor (by ThrowsBeforeTheRecovery)}
  , Mutant "rSelect takes a dead sensor for false" deadSensors sound {rSelect = rSelect (by TakesDeadForFalse)}
  , Mutant "monitor takes a dead sensor for false" deadSensors sound {monitor = monitor (by TakesDeadForFalse)}
  , Mutant "a polled sensor is read at once after a recovery" nothingSpins sound {polling = polling (by ForgetsThePeriod)}
  , Mutant "timeout takes the stop of another operator for its own" heard sound {timeout = timeout (by MistakesTheStop)}
  , Mutant "firstOf does not say which branch a thread runs" labelled sound {firstOf = firstOf (by DoesNotLabel)}
  ]
 where
  by = copied . Just
