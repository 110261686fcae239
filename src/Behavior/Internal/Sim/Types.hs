{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE DeriveFunctor #-}

-- |
-- The options of a simulation, and its results.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Types
  ( -- * Options
    SimOptions (..)
  , defaultSimOptions
  , Schedule (..)

    -- * Results
  , Run (..)
  , Outcome (..)
  , Waiting (..)
  , Blocked (..)
  , Step (..)
  , StepKind (..)
  ) where

import Control.Exception (SomeException)

import Behavior.Internal.Core.Backend (Label)
import Behavior.Internal.Core.Seconds (Seconds)
import Behavior.Internal.Spans.Event (Event)

-- | How to simulate.
--
-- @since 0.1.0.0
data SimOptions = SimOptions
  { scheduled :: Schedule
  -- ^ Which thread runs when several are enabled.
  , endAt :: Seconds
  -- ^ The virtual time at which the run is ended ('OutOfTime'); infinite by default. If before that time
  -- nothing can run any more, the run ends with a 'Deadlock' all the same; its virtual time still goes on to
  -- this one, so that the record of a mock world is complete until then.
  , livelockLimit :: Int
  -- ^ After this number of scheduling points during which the virtual time does not advance, the
  -- run is ended ('Livelock'); 100,000 by default.
  , realTimeLimit :: Seconds
  -- ^ After this amount of real time the run is ended ('TooSlow'); 9 s by default. A time in which the process does
  -- not run (it is stopped, or other programs have the processors) does not count.
  , timerSlip :: Seconds
  -- ^ A sleeper may be late by less than this. Whenever the virtual time advances, the schedule chooses among
  -- the moments at which a sleeper is due: the first one, and those that are less than this after it.
  -- By default 0: timers are exact.
  , detailedSteps :: Bool
  -- ^ Whether 'steps' contains every operation, and not only the starts and ends of threads,
  -- the exceptions that they receive, and their notes; by default 'False'.
  }

-- | The non-preemptive schedule, no end, and the defaults that are documented for each field
-- of 'SimOptions'.
--
-- @since 0.1.0.0
defaultSimOptions :: SimOptions
defaultSimOptions =
  SimOptions
    { scheduled = NonPreemptive
    , endAt = 1 / 0
    , livelockLimit = 100000
    , realTimeLimit = 9
    , timerSlip = 0
    , detailedSteps = False
    }

-- | Which thread runs when several are enabled.
--
-- @since 0.1.0.0
data Schedule
  = -- | A thread runs until it has to wait; then the next enabled thread runs, in the order of
    -- their numbers, and after the last the first again.
    NonPreemptive
  | -- | The non-preemptive schedule, except that at the scheduling point with the first number
    -- the thread with the second number runs. 'Behavior.Sim.explore' prints schedules in this
    -- form.
    Preempting [(Int, Int)]
  | -- | A random schedule: equal numbers give equal schedules.
    Seeded Int
  deriving (Eq, Show, Read)

-- | The result of a simulated run.
--
-- @since 0.1.0.0
data Run a = Run
  { outcome :: Outcome a
  , finished :: Seconds
  -- ^ The virtual time when the run ended. It began at 0.
  , steps :: [Step]
  -- ^ The steps, from the beginning.
  , events :: [Event]
  -- ^ The events of its trace ("Behavior.Trace"), with operators and branches. What had not ended
  -- when the run ended has no end.
  , runSchedule :: Schedule
  -- ^ The schedule that replays this run: a 'Preempting'.
  , runPoints :: Int
  -- ^ How many scheduling points the run had.
  , leakedThreads :: [Label]
  -- ^ The threads that had not ended when the run ended.
  }

-- | How a simulated run ended.
--
-- @since 0.1.0.0
data Outcome a
  = -- | The behaviour returned.
    Returned a
  | -- | It threw this: a failure, a fault, or a cancellation that no other thread had thrown to it.
    Threw SomeException
  | -- | All threads wait, and nothing in the simulation will wake one.
    Deadlock [Waiting]
  | -- | The virtual time did not advance for more than 'livelockLimit' scheduling points; the
    -- threads that were enabled then; and for each operator that reacted again and again, to which
    -- values, and what it started.
    Livelock [Label] [String]
  | -- | The virtual time reached 'endAt', and something would have gone on after it; what the threads
    -- waited for.
    OutOfTime [Waiting]
  | -- | This thread waited outside of the simulation, by an operation that is not this library's.
    BlockedOutside Label Blocked
  | -- | Something that is not part of the simulation changed what these threads waited for.
    ExternalWakeup [Waiting]
  | -- | The real time reached 'realTimeLimit' while this thread ran; the virtual time then.
    TooSlow Label Seconds
  | -- | The schedule does not fit this behaviour; the reason.
    ScheduleMismatch String
  deriving (Functor)

-- | A thread, and what it waits for.
--
-- @since 0.1.0.0
data Waiting = Waiting
  { waitingThread :: Label
  , waitingFor :: String
  }
  deriving (Eq, Show)

-- | How a thread waited outside of the simulation.
--
-- @since 0.1.0.0
data Blocked
  = -- | At an @MVar@, or for the time: @takeMVar@, @threadDelay@, @System.Timeout@.
    InMVar
  | -- | In a transaction: @retry@ in @Control.Concurrent.STM.atomically@, the waits of @async@.
    InTransaction
  | -- | For another thread to receive an exception (@throwTo@, @killThread@, @cancel@); and what
    -- the other threads waited for meanwhile.
    InThrowing [Waiting]
  | -- | For a value that another thread was computing, until 'realTimeLimit'.
    InThunk
  | -- | In any other way.
    Elsewhere
  deriving (Eq, Show)

-- | A step of a run.
--
-- @since 0.1.0.0
data Step = Step
  { stepTime :: !Seconds
  , stepPoint :: !Int
  -- ^ The number of the scheduling point.
  , stepThread :: !Int
  -- ^ The number of the thread: threads are numbered from 0, in the order of their starts.
  , stepLabel :: !Label
  , stepParent :: !Int
  -- ^ The number of the thread that started this one; for the first thread -1.
  , stepKind :: StepKind
  }
  deriving (Eq, Show)

-- | What a thread did, or received.
--
-- @since 0.1.0.0
data StepKind
  = Starts
  | Ends
  | Note String
  | -- | It receives an exception that another thread threw to it.
    ReceivesException String
  | -- | It throws an exception to the thread with this number and label. (This and the following
    -- three are only in the steps of a detailed run.)
    Throws Int Label
  | -- | It runs a transaction.
    Transacts
  | -- | It sleeps until this time.
    Sleeps Seconds
  | -- | Another thread runs, although this one is enabled.
    IsPreempted
  deriving (Eq, Show)
