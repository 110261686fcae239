{-# OPTIONS_GHC -O1 #-}
-- |
-- The programs of "Language.Script" in their environment, and what is observed of them.
module Semantics.Program
  ( module Language.Script

    -- * Programs and their environment
  , World (..)
  , Change (..)
  , Caller (..)
  , ExceptionType (..)
  , Level (..)

    -- * Results and transitions
  , Result (..)
  , Transition (..)
  , Timeline
  , BranchLabel
  , noAlternative
  , noValue
  , doesNotHold
  , tooLate
  , childStopped
  , tooFew
  , noneChosen
  , timedOut
  , overdueBy
  , timeIsUp
  , messages
  , roomForMessages
  ) where

import Language.Script

-- | The label of a branch: the operator's name and the branch's.
type BranchLabel = String

-- | The state of a condition.
data Level
  = At Int
  | -- | There is no value: its transaction retries.
    NoValue
  | -- | Its transaction throws a failure.
    ThrowsFailure
  | -- | Its transaction throws a fault.
    ThrowsFault
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

-- | The observable part of a step.
data Transition
  = -- | Not observable.
    Silent
  | Action Name ActionEvent
  | Becomes Condition Level
  | -- | The end of the branch with this label is published.
    IsOver BranchLabel
  deriving (Eq, Ord, Show)

-- | The observed transitions and their times.
type Timeline = [(Ticks, Transition)]

-- | The condition whose level is the number of messages that wait.
messages :: Condition
messages = "messages"

-- | How many messages can wait; the oldest is dropped.
roomForMessages :: Int
roomForMessages = 2

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

-- | The result of a world in which the program was cancelled by its 'Operator'.
timeIsUp :: Value
timeIsUp = Several [Unit, Unit, Unit]
