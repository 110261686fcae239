-- |
-- The library's promises, each as a property of a language.
module Promises.Properties
  ( promises

    -- * One by one
  , structure
  , neverBoth
  , noLostWork
  , noLostFault
  , unmasked
  , heard
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
import Promises.Reactive
import Promises.Stage
import Promises.Tree

-- | All of them.
promises :: [Promise]
promises =
  [ structure
  , neverBoth
  , noLostWork
  , noLostFault
  , unmasked
  , heard
  , together
  , labelled
  , deadSensors
  , nothingSpins
  , causes
  , firstThenLeft
  , latchedRecovery
  , readAfresh
  ]

structure, neverBoth, noLostWork, noLostFault, unmasked, heard, together :: Promise
structure = Promise "Structured: what an operator started has ended before it does" (programsOf AnyRoot) (obeys Structure)
neverBoth = Promise "Never both: a branch starts after the one before has ended" (programsOf ReactiveRoot) (obeys Exclusion)
noLostWork = Promise "No lost work: what completed stands, and is not run again" (programsOf ReactiveRoot) (obeys Work)
noLostFault = Promise "No lost fault: the leftmost fault gets out" (programsOf AnyRoot) (obeys FaultOut)
unmasked = Promise "Interruptible: branches run unmasked, the second of ? as its caller does" (programsOf AnyRoot) (obeys Masking)
heard = Promise "Interruptible: a stop is heard by whom it is meant for" levels stoppedAtItsLevel
together = Promise "Together: all are asked to stop before one is waited for" companies askedTogether

labelled, deadSensors, nothingSpins, causes, firstThenLeft, latchedRecovery, readAfresh :: Promise
labelled = Promise "Labelled: every thread by its operator and branch" (programsOf AnyRoot) (obeys Labels)
deadSensors = Promise "A dead sensor is never false" deaths notTakenForFalse
nothingSpins = Promise "Nothing spins: readings start a period apart" scripts aPeriodApart
causes = Promise "The order of outcomes: each outcome has its cause" (programsOf AnyRoot) (obeys Outcomes)
firstThenLeft = Promise "The order of outcomes: the first to finish, and of those that tie the left one" relays leftWins
latchedRecovery = Promise "A recovery is latched, and ends" missions latched
readAfresh = Promise "A condition is read again after a stop" turns readAgain
