{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE DeriveFunctor #-}

-- |
-- What goes into a simulation, and what comes out of it.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Types
  ( -- * What goes in
    Options (..)
  , defaults
  , Schedule (..)

    -- * What comes out
  , Run (..)
  , Outcome (..)
  , Waiting (..)
  , Blocked (..)
  , Step (..)
  , StepKind (..)
  ) where

import Control.Exception (SomeException)

import Behavior.Internal.Runtime.Backend (Label)
import Behavior.Internal.Seconds (Seconds)

-- | How to simulate.
--
-- @since 0.1.0.0
data Options = Options
  { scheduled :: Schedule
  -- ^ Which thread runs when several could.
  , endAt :: Seconds
  -- ^ The virtual time at which the run is stopped ('OutOfTime'), also if by then no thread
  -- can do anything any more; infinite by default.
  , livelockLimit :: Int
  -- ^ After so many scheduling points without progress of the virtual time the run is
  -- stopped ('Livelock'); 100,000 by default.
  , realTimeLimit :: Seconds
  -- ^ After so much real time the run is stopped ('TooSlow'); 9 s by default.
  , slip :: Seconds
  -- ^ A sleeper may be late by less than this: whenever time moves, the schedule may let it
  -- move on to any moment at which a sleeper is due, less than this after the first. By
  -- default 0: timers are exact.
  , detailed :: Bool
  -- ^ Whether 'steps' has every operation, and not only what happened to threads and what
  -- was noted; by default it has not.
  }

-- | The undisturbed schedule, no end, and the limits that are said with each of 'Options'.
--
-- @since 0.1.0.0
defaults :: Options
defaults =
  Options
    { scheduled = NonPreemptive
    , endAt = 1 / 0
    , livelockLimit = 100000
    , realTimeLimit = 9
    , slip = 0
    , detailed = False
    }

-- | Which thread runs when several could.
--
-- @since 0.1.0.0
data Schedule
  = -- | A thread runs until it has to wait; then it is the turn of the next that can run,
    -- round and round.
    NonPreemptive
  | -- | The undisturbed one but for some exceptions: at the scheduling point of this
    -- number, this thread runs. What 'Behavior.Sim.explore' prints is of this form.
    Preempting [(Int, Int)]
  | -- | A random one: the same number, the same schedule.
    Seeded Int
  deriving (Eq, Show, Read)

-- | What came of a simulated run.
--
-- @since 0.1.0.0
data Run a = Run
  { outcome :: Outcome a
  , finished :: Seconds
  -- ^ The virtual time when it ended. It began at 0.
  , steps :: [Step]
  -- ^ What happened, from the beginning.
  , schedule :: Schedule
  -- ^ Replays this very run: a 'Preempting'.
  , points :: Int
  -- ^ How many scheduling points it had.
  , leakedThreads :: [Label]
  -- ^ The threads that had not ended when the behaviour had.
  }

-- | How a simulated run ended.
--
-- @since 0.1.0.0
data Outcome a
  = -- | The behaviour returned.
    Returned a
  | -- | It failed.
    Failing SomeException
  | -- | It threw anything else that is no cancellation.
    Faulting SomeException
  | -- | It threw a cancellation that nobody had sent to it.
    Cancelled SomeException
  | -- | All threads wait, and nothing will ever wake one.
    Deadlock [Waiting]
  | -- | The virtual time stood still for too many scheduling points; the threads that ran last.
    Livelock [Label]
  | -- | The virtual time came to 'endAt'.
    OutOfTime
  | -- | This thread waited for something that is not this library's.
    BlockedOutside Label Blocked
  | -- | Something that is not part of the simulation changed what these threads waited for.
    ExternalWakeup [Waiting]
  | -- | The real time came to 'realTimeLimit', while this thread ran; the virtual time was this.
    TooSlow Label Seconds
  | -- | The schedule is not one of this behaviour: why not.
    ScheduleMismatch String
  deriving (Functor)

-- | Who waits for what.
--
-- @since 0.1.0.0
data Waiting = Waiting
  { who :: Label
  , what :: String
  }
  deriving (Eq, Show)

-- | In what a thread waited, when it was not by this library.
--
-- @since 0.1.0.0
data Blocked
  = -- | An @MVar@, or the time: @takeMVar@, @threadDelay@, @System.Timeout@.
    InMVar
  | -- | A transaction: @retry@ in @Control.Concurrent.STM.atomically@, the waits of @async@.
    InTransaction
  | -- | Another thread that was thrown to (@throwTo@, @killThread@, @cancel@), and what the
    -- others waited for meanwhile.
    InThrowing [Waiting]
  | -- | A value that another thread was computing, up to 'realTimeLimit'.
    InThunk
  | -- | Anything else.
    Elsewhere
  deriving (Eq, Show)

-- | One thing that happened.
--
-- @since 0.1.0.0
data Step = Step
  { at :: !Seconds
  , point :: !Int
  -- ^ The number of the scheduling point.
  , number :: !Int
  -- ^ The number of the thread, in the order in which they were started, from 0.
  , label :: !Label
  , parentNumber :: !Int
  -- ^ The number of the thread that started it; of the first thread it is -1.
  , did :: StepKind
  }
  deriving (Eq, Show)

-- | What a thread did, or what was done to it.
--
-- @since 0.1.0.0
data StepKind
  = Starts
  | Ends
  | Note String
  | -- | An exception arrived that another thread had thrown to it.
    ReceivesException String
  | -- | The last four only in a detailed run. It throws an exception to this thread.
    Throws Int Label
  | -- | It runs a transaction.
    Transacts
  | -- | It sleeps until then.
    Sleeps Seconds
  | -- | Another one runs, although this one could go on.
    IsPreempted
  deriving (Eq, Show)
