-- |
-- The library's promises, each as a property of a language.
module Promises.Properties
  ( promises

    -- * Each promise
  , structure
  , neverBoth
  , noLostWork
  , noLostFault
  , unmasked
  , ownLevel
  , together
  , labelled
  , deadSensors
  , nothingSpins
  , causes
  , firstThenLeft
  , latchedRecovery
  , readAfresh
  ) where

import Promises.Concurrent
import Promises.Contract
import Promises.Program
import Promises.Reactive
import Promises.Stage

-- | All of them.
promises :: [Promise]
promises =
  [ structure
  , neverBoth
  , noLostWork
  , noLostFault
  , unmasked
  , ownLevel
  , together
  , labelled
  , deadSensors
  , nothingSpins
  , causes
  , firstThenLeft
  , latchedRecovery
  , readAfresh
  ]

structure, neverBoth, noLostWork, noLostFault, unmasked, ownLevel, together :: Promise
structure =
  Promise "Structured: what an operator started has ended before it does"
    (programsOf AnyRoot) (satisfies Structure)
neverBoth =
  Promise "Never both: a branch starts after the one before has ended"
    (programsOf ReactiveRoot) (satisfies Exclusion)
noLostWork =
  Promise "No lost work: the result of a completed branch is kept, and the branch does not run again"
    (programsOf ReactiveRoot) (satisfies Work)
noLostFault =
  Promise "No lost fault: the leftmost fault is thrown"
    (programsOf AnyRoot) (satisfies FaultOut)
unmasked =
  Promise "Interruptible: branches run unmasked, and the second of ? in its caller's masking state"
    (programsOf AnyRoot) (satisfies Masking)
ownLevel =
  Promise "Interruptible: a stop request stops only what it is meant for"
    levels stoppedAtItsOwnLevel
together =
  Promise "Together: all stop requests are made before the operator waits for a branch"
    groups stoppedTogether

labelled, deadSensors, nothingSpins, causes, firstThenLeft, latchedRecovery, readAfresh :: Promise
labelled =
  Promise "Labelled: every thread has its operator's and its branch's name"
    (programsOf AnyRoot) (satisfies Labels)
deadSensors =
  Promise "A dead sensor is never false"
    sensorFailures notTakenForFalse
nothingSpins =
  Promise "Nothing spins: readings start at least a period apart"
    scripts aPeriodApart
causes =
  Promise "The order of outcomes: each outcome has a cause in the branches"
    (programsOf AnyRoot) (satisfies Outcomes)
firstThenLeft =
  Promise "The order of outcomes: the first branch to finish decides, on a tie the left one"
    relays leftWins
latchedRecovery =
  Promise "A recovery runs to its end, even if the condition becomes false"
    missions latched
readAfresh =
  Promise "A condition is read again after a stop"
    toggles readAgain
