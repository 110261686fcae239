{-# OPTIONS_GHC -O1 #-}
-- |
-- Programs of the language, as plain data.
--
-- An action has a name, and a script for each call: how many ticks it takes, how it then
-- ends, and how it responds to a stop request. A condition is a variable that the
-- environment sets at given times.
module Semantics.Program
  ( -- * Programs
    Program (..)
  , Choice (..)
  , Signal (..)
  , Name
  , BranchLabel
  , Ticks

    -- * What actions do
  , Script (..)
  , Masking (..)
  , Ending (..)
  , OnStop (..)

    -- * Conditions
  , Condition
  , Level (..)

    -- * Programs and their environment
  , World (..)
  , Change (..)
  , Caller (..)
  , ExceptionType (..)

    -- * Results and transitions
  , Result (..)
  , Value (..)
  , Transition (..)
  , ActionEvent (..)
  , Timeline
  , number
  , holds
  , noAlternative
  , noValue
  , doesNotHold
  , tooLate
  , childStopped
  , tooFew
  , noneChosen
  , timedOut
  , overdueBy
  , cleanupOf
  , timeIsUp
  ) where

type Name = String

-- | A time, or a duration.
type Ticks = Int

data Program
  = -- | The n-th call follows the n-th script; the last script repeats.
    Do Name [Script]
  | -- | Returns the value.
    Pure Value
  | -- | @>>@
    Program `Then` Program
  | -- | @?@
    Program `Else` Program
  | Attempt Int Program
  | FallbackOver [Program]
  | Parallel Program Program
  | Both Program Program
  | FirstOf [Program]
  | AllOf [Program]
  | -- | What is chosen runs the last program, or fails.
    Decide Choice [Program] Program
  | RSelect Signal Program Program
  | Monitor Signal Program Program
  | InsteadWhen Signal Program Program
  | -- | The number is the index of the branch, from zero; larger numbers select the last
    -- branch.
    Switch Signal [Program]
  | TeleoReactive [(Signal, Program)]
  | WaitUntil Signal
  | WhileHolding Signal Program
  | Timeout Ticks Program
  | -- | The program may follow the signal as 'Shared'.
    WithShared Signal Program
  | Scoped Program
  | -- | Forks into the nearest 'Scoped' around it.
    Fork Program
  | -- | Forks the first, runs the second, and waits for the result of the first.
    Await Program Program
  | -- | Likewise, but requests the stop of the first before it waits.
    StopChild Program Program
  deriving (Eq, Ord, Show)

-- | How 'Decide' chooses.
data Choice
  = -- | When that many have succeeded. It fails when too few are left.
    AtLeast Int
  | -- | When the first has ended: it fails as that has, if it has.
    FirstEnd
  | -- | Never.
    NoChoice
  deriving (Eq, Ord, Show)

-- | A signal's value is a number; as a condition it 'holds' or not.
data Signal
  = Watched Condition
  | -- | The reading is the result of the program, which runs once in each period.
    Polled Ticks Program
  | -- | One where both hold, otherwise zero.
    And Signal Signal
  | -- | One where it is high, otherwise zero. The lower threshold comes first.
    Hysteresis Bool Int Int Signal
  | Debounce Ticks Signal
  | Throttle Ticks Signal
  | StaleAfter Ticks Signal
  | -- | The signal of the nearest 'WithShared' around it.
    Shared
  deriving (Eq, Ord, Show)

-- | One call of an action.
data Script = Script
  { takes :: Ticks
  , ends :: Ending
  , masking :: Masking
  , onStop :: OnStop
  }
  deriving (Eq, Ord, Show)

data Masking
  = -- | A stop request is received at any moment.
    Unmasked
  | -- | A stop request is received while the action blocks.
    Masked
  | -- | No stop request is received.
    Uninterruptible
  deriving (Eq, Ord, Show, Enum, Bounded)

data Ending
  = Succeeds Int
  | Fails
  | Faults
  deriving (Eq, Ord, Show)

-- | What an action does after it has received a stop request.
data OnStop
  = StopsAtOnce
  | -- | Stops after a cleanup of the given number of ticks.
    StopsAfter Ticks
  | -- | Likewise, but another stop request ends the cleanup.
    CleansUpInterruptibly Ticks
  | -- | Does not stop, but ends after the given number of ticks: it completes, or its
    -- cleanup fails or faults.
    EndsAfter Ticks Ending
  deriving (Eq, Ord, Show)

type Condition = Name

-- | The label of a branch: the operator's name and the branch's.
type BranchLabel = String

-- | The state of a condition.
data Level
  = At Int
  | -- | There is no value: its transaction retries.
    NoValue
  | -- | Its transaction throws a failure.
    Failing
  | -- | Its transaction throws a fault.
    Faulting
  deriving (Eq, Ord, Show)

-- | A program, the initial levels of the conditions, their changes, and when the caller
-- cancels the program.
data World = World
  { conditions :: [(Condition, Level)]
  , changes :: [Change]
  -- ^ In the order of their times.
  , cancelAt :: Ticks
  , program :: Program
  , caller :: Caller
  , slippage :: Ticks
  -- ^ A timer may be late by less than this.
  }
  deriving (Eq, Ord, Show)

-- | The origin of the cancellation.
data Caller
  = -- | An operator.
    --
    -- > firstOf [program, the environment, which makes the changes]
    Operator
  | -- | The program runs in a thread of its own, to which another thread throws an exception;
    -- and a second one after the given number of ticks.
    PlainThread ExceptionType Ticks
  deriving (Eq, Ord, Show)

-- | The type of the exceptions that are thrown to a 'PlainThread'.
data ExceptionType = Asynchronous | Synchronous
  deriving (Eq, Ord, Show)

-- | When a condition changes, and to what.
data Change = Change Ticks Condition Level
  deriving (Eq, Ord, Show)

-- | How a program, or a branch, ends.
data Result
  = Succeeded Value
  | FailedWith String
  | FaultedWith String
  | -- | It stopped because of a stop request; a fault may have occurred while it stopped.
    Stopped (Maybe String)
  deriving (Eq, Ord, Show)

data Value
  = Unit
  | Number Int
  | Several [Value]
  deriving (Eq, Ord, Show)

-- | The observable part of a step.
data Transition
  = -- | Not observable.
    Silent
  | Action Name ActionEvent
  | Becomes Condition Level
  | -- | The end of the branch with this label is published.
    IsOver BranchLabel
  deriving (Eq, Ord, Show)

data ActionEvent
  = Begins
  | -- | It has ended without stopping, by itself or by its cleanup.
    Ends Ending
  | -- | It has received a stop request (and has stopped, if it stops at once).
    ReceivesStop
  | -- | It has stopped, after a cleanup.
    Stops
  deriving (Eq, Ord, Show)

-- | The observed transitions and their times.
type Timeline = [(Ticks, Transition)]

-- | A result as a signal's value.
number :: Value -> Int
number (Number n) = n
number _ = 0

-- | A number as a condition.
holds :: Int -> Bool
holds = (> 0)

-- The library's own failures.

noAlternative, noValue, doesNotHold, tooLate, childStopped, tooFew, noneChosen :: String
noAlternative = "Failed"
noValue = "FailedBecause \"the signal has no value any more\""
doesNotHold = "FailedBecause \"the condition does not hold\""
tooLate = "FailedBecause \"fork: the nursery's scoped behaviour is ending\""
childStopped = "ChildStopped"
tooFew = "FailedBecause \"too few have succeeded\""
noneChosen = "decide: all behaviours have ended, and the function has chosen none"

timedOut :: Ticks -> String
timedOut n = "TimedOut " ++ show n ++ ".0"

overdueBy :: Ticks -> String
overdueBy n = "FailedBecause \"no reading of the signal within " ++ show n ++ ".0 s\""

-- | The name in the failure or fault of an action's cleanup.
cleanupOf :: Name -> String
cleanupOf name = name ++ "'s cleanup"

-- | The result of a world in which the program was cancelled by its 'Operator'.
timeIsUp :: Value
timeIsUp = Several [Unit, Unit, Unit]
