-- |
-- Languages in which one operator is broken, each by a mistake that was made in practice.
-- A promise must reject every one.
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
  -- ^ A promise that it breaks. (It may break others, too.)
  , spoken :: Language
  }

-- | The copy without a flaw, which must keep every promise.
copy :: Language
copy = copied Nothing

mutants :: [Mutant]
mutants =
  [ Mutant "parallel returns while the loser still cleans up" structure
      sound {parallel = parallel (by ReturnsBeforeTheLoser)}
  , Mutant "scoped returns while what it forked still cleans up" structure
      sound {beside = beside (by ReturnsBeforeTheLoser)}
  , Mutant "firstOf leaves its branches running when its caller is cancelled a second time" structure
      sound {firstOf = firstOf (by OrphansAtSecondCancel)}
  , Mutant "allOf requests a stop again at a second cancellation, which interrupts a cleanup" structure
      sound {allOf = allOf (by RequestsStopTwice)}
  , Mutant "? catches a cancellation" ownLevel
      sound {fallback = fallback (by SwallowsCancellation)}
  , Mutant "attempt catches a cancellation" ownLevel
      sound {attempt = attempt (by SwallowsCancellation)}
  , Mutant "monitor takes an exception thrown to its caller for its sensor's" causes
      sound {monitor = monitor (by TakesForeignExceptionAsItsOwn)}
  , Mutant "parallel goes on when an exception of a synchronous type is thrown to its caller" noLostFault
      sound {parallel = parallel (by TakesForeignExceptionAsItsOwn)}
  , Mutant "failingOn takes a cancellation for a fault" ownLevel
      sound {failing = failing (by FailsWhenCancelled)}
  , Mutant "the second of ? runs in an exception handler, masked" unmasked
      sound {fallback = fallback (by RecoversInAHandler)}
  , Mutant "branches of both inherit the caller's masking state" unmasked
      sound {both = both (by InheritsMasking)}
  , Mutant "a branch of firstOf that is killed before its handler is installed publishes no result" structure
      sound {firstOf = firstOf (by PublishesByAHandler)}
  , Mutant "parallel stops one branch after the other" together
      sound {parallel = parallel (by StopsOneByOne)}
  , Mutant "on a tie in firstOf the right branch decides" firstThenLeft
      sound {firstOf = firstOf (by RightWinsTies)}
  , Mutant "both waits for the left branch before it reads the right one's outcome" firstThenLeft
      sound {both = both (by WaitsFromLeftToRight)}
  , Mutant "parallel loses a fault in the loser's cleanup" noLostFault
      sound {parallel = parallel (by DropsTheLosersFault)}
  , Mutant "allOf throws the rightmost fault" noLostFault
      sound {allOf = allOf (by ThrowsTheRightmostFault)}
  , Mutant "both throws the fault of a cleanup in place of the cancellation" causes
      sound {both = both (by HidesCancellationByAFault)}
  , Mutant "decide asks its function only when all have ended" firstThenLeft
      sound {decide = decide (by ChoosesWhenAllHaveEnded)}
  , Mutant "decide runs what it has chosen while the others still clean up" structure
      sound {decide = decide (by RunsTheChosenTooEarly)}
  , Mutant "rSelect starts the other branch before this one has ended" neverBoth
      sound {rSelect = rSelect (by StartsBeforeTheEnd)}
  , Mutant "monitor starts the recovery before the task has ended" neverBoth
      sound {monitor = monitor (by StartsBeforeTheEnd)}
  , Mutant "rSelect goes on although the branch completed despite its stop request" noLostWork
      sound {rSelect = rSelect (by RunsTheCompletedAgain)}
  , Mutant "monitor runs a task again that completed despite its stop request" noLostWork
      sound {monitor = monitor (by RunsTheCompletedAgain)}
  , Mutant "timeout loses a result that was returned despite the stop request" noLostWork
      sound {timeout = timeout (by DropsWhatCompletedInTime)}
  , Mutant "rSelect starts a branch by the condition's value from before the stop" readAfresh
      sound {rSelect = rSelect (by DoesNotReadAgain)}
  , Mutant "monitor skips the recovery when the condition is false again after the stop" latchedRecovery
      sound {monitor = monitor (by ReadsAgainBeforeTheRecovery)}
  , Mutant "monitor watches the condition while the recovery runs" latchedRecovery
      sound {monitor = monitor (by WatchesDuringTheRecovery)}
  , Mutant "monitor throws a cleanup's failure or fault, and does not run the recovery" latchedRecovery
      sound {monitor = monitor (by ThrowsBeforeTheRecovery)}
  , Mutant "rSelect takes a dead sensor for false" deadSensors
      sound {rSelect = rSelect (by TakesDeadForFalse)}
  , Mutant "monitor takes a dead sensor for false" deadSensors
      sound {monitor = monitor (by TakesDeadForFalse)}
  , Mutant "polling reads its sensor at once after a recovery" nothingSpins
      sound {polling = polling (by ForgetsThePeriod)}
  , Mutant "timeout takes another operator's stop request for its own" ownLevel
      sound {timeout = timeout (by MistakesTheStop)}
  , Mutant "firstOf does not label a thread with its branch" labelled
      sound {firstOf = firstOf (by DoesNotLabel)}
  ]
 where
  by = copied . Just
