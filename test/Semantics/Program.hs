-- |
-- Programs of the language, as plain data.
--
-- An action is a name and what it does each time it is called: it takes so many
-- ticks, then ends in some way; and it does something of its own when it is asked
-- to stop. A condition is a variable that an environment sets at given times.
module Semantics.Program
  ( -- * Programs
    Program (..)
  , Signal (..)
  , Name
  , Label
  , Ticks

    -- * What actions do
  , Script (..)
  , Masking (..)
  , Ending (..)
  , Response (..)

    -- * Conditions
  , Condition
  , Level (..)

    -- * Programs and the world that they act in
  , World (..)
  , Change (..)
  , Caller (..)
  , ExceptionType (..)

    -- * What comes of them
  , Result (..)
  , Value (..)
  , Transition (..)
  , Deed (..)
  , Timeline
  , number
  , holds
  , nothingElse
  , noValue
  , doesNotHold
  , tooLate
  , childStopped
  , timedOut
  , overdueBy
  , cleanupOf
  , timeIsUp
  ) where

type Name = String

-- | Time, and lengths of time.
type Ticks = Int

data Program
  = -- | The n-th call does what the n-th script says; the last one goes on for ever.
    Do Name [Script]
  | -- | Nothing, with a result.
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
  | RSelect Signal Program Program
  | Monitor Signal Program Program
  | -- | The branch for a number is that many places from the first; beyond the last
    -- it is the last.
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
  | -- | Likewise, but before it waits it asks the first to stop.
    Retract Program Program
  deriving (Eq, Ord, Show)

-- | A signal carries a number; as a condition it 'holds' or not.
data Signal
  = Watched Condition
  | -- | What the program returns is the reading.
    Polled Ticks Program
  | -- | One where both hold, otherwise zero.
    And Signal Signal
  | -- | One where it is high, otherwise zero. The lower threshold comes first.
    Hysteresis Bool Int Int Signal
  | Debounce Ticks Signal
  | StaleAfter Ticks Signal
  | -- | The signal of the nearest 'WithShared' around it.
    Shared
  deriving (Eq, Ord, Show)

-- | One call of an action.
data Script = Script
  { takes :: Ticks
  , ends :: Ending
  , masking :: Masking
  , whenAsked :: Response
  }
  deriving (Eq, Ord, Show)

data Masking
  = -- | It hears a request to stop at any moment.
    Unmasked
  | -- | It hears a request while it waits.
    Masked
  | -- | It hears nothing.
    Uninterruptible
  deriving (Eq, Ord, Show, Enum, Bounded)

data Ending
  = Succeeds Int
  | Fails
  | Faults
  deriving (Eq, Ord, Show)

-- | What an action does that has heard that it should stop.
data Response
  = StopsAtOnce
  | -- | Stops after a cleanup of so many ticks.
    StopsAfter Ticks
  | -- | Likewise, unless it is asked again: that ends the cleanup.
    TidiesUp Ticks
  | -- | Ends after so many ticks in a way of its own: it completes although asked
    -- to stop, or its cleanup goes wrong.
    EndsAfter Ticks Ending
  deriving (Eq, Ord, Show)

type Condition = Name

-- | The name of a branch: the operator's, and its own.
type Label = String

-- | What a condition may be at.
data Level
  = At Int
  | -- | There is no value: its transaction retries.
    Lost
  | -- | Its transaction throws a failure.
    Failing
  | -- | Its transaction throws a fault.
    Faulting
  deriving (Eq, Ord, Show)

-- | A program, the conditions as they are at first, how they change, and when the
-- caller loses patience and the program is asked to stop.
data World = World
  { conditions :: [(Condition, Level)]
  , changes :: [Change]
  -- ^ In the order of their times.
  , patience :: Ticks
  , program :: Program
  , caller :: Caller
  , slippage :: Ticks
  -- ^ By less than so much a timer may be late.
  }
  deriving (Eq, Ord, Show)

-- | Who asks the program to stop.
data Caller
  = -- | An operator.
    --
    -- > firstOf [program, the environment, which makes the changes]
    Operator
  | -- | A thread that knows nothing of operators; after the given number of ticks it throws
    -- again.
    Stranger ExceptionType Ticks
  deriving (Eq, Ord, Show)

-- | Of what type the exceptions are that a stranger throws.
data ExceptionType = Asynchronous | Synchronous
  deriving (Eq, Ord, Show)

-- | When a condition changes, and to what.
data Change = Change Ticks Condition Level
  deriving (Eq, Ord, Show)

-- | How a program, or a branch, ends.
data Result
  = Succeeded Value
  | Failed String
  | Faulted String
  | -- | It stopped because it was asked to; perhaps it met a fault on the way.
    Stopped (Maybe String)
  deriving (Eq, Ord, Show)

data Value
  = Unit
  | Number Int
  | Several [Value]
  deriving (Eq, Ord, Show)

-- | What happens in a step.
data Transition
  = -- | Nothing that anybody can see.
    Silent
  | Name `Does` Deed
  | Becomes Condition Level
  | -- | The branch of this name is known to have ended.
    IsOver Label
  deriving (Eq, Ord, Show)

data Deed
  = Begins
  | -- | It has ended by itself, or its cleanup has.
    Ends Ending
  | -- | It has heard that it should stop (and if it stops at once, has stopped).
    Hears
  | -- | It has stopped, after a cleanup.
    Stops
  deriving (Eq, Ord, Show)

-- | What could be seen, and when.
type Timeline = [(Ticks, Transition)]

-- | A result as a number, for those who read signals.
number :: Value -> Int
number (Number n) = n
number _ = 0

-- | A number as a condition.
holds :: Int -> Bool
holds = (> 0)

-- The library's own failures.

nothingElse, noValue, doesNotHold, tooLate, childStopped :: String
nothingElse = "Failed"
noValue = "FailedBecause \"the signal has no value any more\""
doesNotHold = "FailedBecause \"the condition does not hold\""
tooLate = "FailedBecause \"fork: the nursery's scoped behaviour is ending\""
childStopped = "ChildStopped"

timedOut :: Ticks -> String
timedOut n = "TimedOut " ++ show n ++ ".0"

overdueBy :: Ticks -> String
overdueBy n = "FailedBecause \"no reading of the signal within " ++ show n ++ ".0 s\""

-- | The name under which the cleanup of an action fails or faults.
cleanupOf :: Name -> String
cleanupOf name = name ++ "'s cleanup"

-- | The result of a world in which the caller has lost patience.
timeIsUp :: Value
timeIsUp = Several [Unit, Unit, Unit]
