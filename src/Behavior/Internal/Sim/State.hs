{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE RecordWildCards #-}

-- |
-- The data types of a simulation.
--
-- Each simulated thread is a real thread, a 'Task', that runs only while it has the turn, and
-- otherwise waits at its own gate. Only the task that has the turn reads and writes the state
-- of the simulation, so the state needs no locks. (The state is in many cells, and not in one record: a change of one
-- field would copy the whole record. And at the end of a run the driver writes some cells while a task still runs.)
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.State
  ( -- * Simulations
    Sim (..)
  , newSim
  , endRun

    -- * Tasks
  , Task (..)
  , newTask
  , BlockedAt (..)
  , Operation (..)
  , EnabledCache (..)
  , Pending (..)
  , Unwind (..)

    -- * Counting
  , turnLimit
  , tick
  , committed

    -- * The record
  , recordStep
  , recordDetail
  , recordReceived
  ) where

import Control.Concurrent
import Control.Exception
import Control.Monad (unless, when)
import Data.IORef
import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Void (Void)

import Behavior.Internal.Core.Backend
import Behavior.Internal.Core.SafeText (safeShow)
import Behavior.Internal.Core.Seconds (Seconds)
import Behavior.Internal.Core.Stop (Stop)
import Behavior.Internal.Sim.Coverage (Reached, nothingYet)
import Behavior.Internal.Sim.Policy
import Behavior.Internal.Sim.Types
import Behavior.Internal.Spans.Event (Event)

-- | A simulation.
data Sim = Sim
  { options :: !SimOptions
  , policyOf :: !Policy
  , capability :: !Int
  -- ^ All tasks are on one capability, so that passing the turn costs little.
  , current :: !(IORef Task)
  -- ^ The task that has the turn.
  , tasks :: !(IORef (IntMap Task))
  -- ^ The tasks that have not ended.
  , threads :: !(IORef (Map ThreadId Task))
  -- ^ The same without helper tasks, by their threads.
  , ready :: !(IORef (Map Int Task))
  -- ^ The tasks that are known to be enabled: a choice does not check them again.
  , awaiting :: !(IORef (IntMap Task))
  -- ^ The tasks before a transaction: other tasks can make it possible or impossible.
  , sleepers :: !(IORef (Map (Seconds, Int) Task))
  -- ^ The tasks that sleep, by the time at which they are due.
  , nextNumber :: !(IORef Int)
  , time :: !(IORef Seconds)
  , counter :: !(IORef Int)
  -- ^ The number of the current scheduling point.
  , nextDecisionAt :: !(IORef Int)
  -- ^ Before this point, the task that has the turn keeps it as long as it is enabled.
  , rotateAt :: !(IORef Int)
  -- ^ At this point another enabled task gets the turn.
  , timeMovedAt :: !(IORef Int)
  -- ^ The point at which the virtual time last advanced.
  , commits :: !(IORef Int)
  -- ^ How many transactions were committed: each may have enabled another one.
  , deviations :: !(IORef [(Int, Int)])
  -- ^ The choices that deviate from the non-preemptive schedule, the latest first.
  , history :: !(IORef [Step])
  -- ^ The steps, the latest first.
  , mistaken :: !(IORef (Maybe SomeException))
  -- ^ What makes the run void.
  , emitted :: !(IORef [Event])
  -- ^ The events of its trace, the latest first.
  , reached :: !(IORef Reached)
  -- ^ What its operators and mock worlds can start, and what of that they have started.
  , runEnd :: !(MVar (Maybe (Outcome Void)))
  -- ^ How the run ended; 'Nothing': as the behaviour did. The task that puts it no longer has
  -- the turn.
  , unwinding :: !(IORef Bool)
  -- ^ Whether the run has ended, and its tasks are being ended.
  , driverRuns :: !(IORef Bool)
  -- ^ Whether the driver (the caller's thread) gives the turn to one task after the other.
  , driverTurn :: !(MVar ())
  -- ^ Filled when a task returns the turn to the driver.
  , unwindAttempts :: !(IORef Int)
  -- ^ How many operations the task that is being unwound has begun.
  , responded :: !(IORef Bool)
  -- ^ Whether the capability has run the thread that the watchdog last put into its queue.
  }

-- | A simulated thread; or a helper task, which has no thread and only throws.
data Task = Task
  { taskNumber :: !Int
  , taskLabel :: !Label
  , taskThread :: !(Maybe ThreadId)
  , gate :: !(MVar ())
  , blockedAt :: !(IORef BlockedAt)
  , pendingException :: !(IORef (Maybe SomeException))
  -- ^ An exception that it can receive where it is blocked: it raises this in its next turn.
  , pending :: !(IORef [Pending])
  -- ^ Exceptions that it cannot receive there, the newest first.
  , parent :: !Int
  }

-- | Where a task is blocked while it does not have the turn.
data BlockedAt
  = Unstarted
  | Before !MaskingState !Operation
  | Gone

-- | The next operation of a task, as far as it determines whether the task is enabled.
data Operation
  = AlwaysEnabled
  | Transaction (IO Bool) !(IORef EnabledCache)
  | Moment !Seconds
  | -- | A helper task is about to throw.
    Throwing !Task SomeException
  | -- | The task waits until this exception, which it threw, is raised.
    Delivery !Task !Pending

-- | An exception that GHC itself raises in its target as soon as the target unmasks: a real
-- thread, on the capability of all tasks, is blocked in a real 'throwTo'.
data Pending = Pending
  { throwingThread :: !ThreadId
  , thrown :: SomeException
  , released :: !(IORef Bool)
  -- ^ Whether it was raised or withdrawn, or the target has ended.
  , sender :: !(Maybe Task)
  -- ^ The task that waits until it is raised; 'Nothing' if a helper task threw it.
  }

-- | The number of commits when a transaction was last tried, whether it could commit then,
-- and whether in any try it could not: then its task has begun to wait.
data EnabledCache = EnabledCache !Int !Bool !Bool

-- | The exception that unwinds a task when the run has ended.
data Unwind = Unwind

instance Show Unwind where
  show Unwind = "Unwind: the simulation has ended"

instance Exception Unwind where
  toException = asyncExceptionToException
  fromException = asyncExceptionFromException

-- | A simulation without tasks, on the caller's capability.
newSim :: SimOptions -> Policy -> IO Sim
newSim options policyOf = do
  (capability, _) <- threadCapability =<< myThreadId
  firstDecision <- askAt policyOf
  noGate <- newEmptyMVar
  current <- newTask (-1) (Label "no task" "") Nothing noGate (-1) Unstarted >>= newIORef
  tasks <- newIORef IntMap.empty
  threads <- newIORef Map.empty
  ready <- newIORef Map.empty
  awaiting <- newIORef IntMap.empty
  sleepers <- newIORef Map.empty
  nextNumber <- newIORef 0
  time <- newIORef 0
  counter <- newIORef 0
  nextDecisionAt <- newIORef (min firstDecision turnLimit)
  rotateAt <- newIORef turnLimit
  timeMovedAt <- newIORef 0
  commits <- newIORef 0
  deviations <- newIORef []
  history <- newIORef []
  mistaken <- newIORef Nothing
  emitted <- newIORef []
  reached <- newIORef nothingYet
  runEnd <- newEmptyMVar
  unwinding <- newIORef False
  driverRuns <- newIORef False
  driverTurn <- newEmptyMVar
  unwindAttempts <- newIORef 0
  responded <- newIORef True
  pure Sim {..}

-- | A task that has this number, label, thread and gate, was started by the task with that number, and is blocked
-- here.
newTask :: Int -> Label -> Maybe ThreadId -> MVar () -> Int -> BlockedAt -> IO Task
newTask taskNumber taskLabel taskThread gate parent here = do
  blockedAt <- newIORef here
  pendingException <- newIORef Nothing
  pending <- newIORef []
  pure Task {..}

-- | The number of points for which one task keeps the turn in the non-preemptive schedule.
turnLimit :: Int
turnLimit = 1000

-- | Ends the run. If it was ended already (by the watchdog), the turn goes to the driver.
endRun :: Sim -> Maybe (Outcome Void) -> IO ()
endRun sim verdict = do
  first <- tryPutMVar (runEnd sim) verdict
  unless first (putMVar (driverTurn sim) ())

-- | Counts a scheduling point, and returns its number.
tick :: Sim -> IO Int
tick sim = do
  n <- (+ 1) <$> readIORef (counter sim)
  writeIORef (counter sim) $! n
  pure n
{-# INLINE tick #-}

-- | Counts a committed transaction: it may have enabled other tasks.
committed :: Sim -> IO ()
committed sim = do
  n <- readIORef (commits sim)
  writeIORef (commits sim) $! n + 1

-- | Records a step of the task that has the turn.
recordStep :: Sim -> StepKind -> IO ()
recordStep sim kind = do
  me <- readIORef (current sim)
  t <- readIORef (time sim)
  n <- readIORef (counter sim)
  -- (A thunk would keep the task, and its thread.)
  let step = Step t n (taskNumber me) (taskLabel me) (parent me) kind
  step `seq` modifyIORef' (history sim) (step :)

-- | The same, only in a detailed run.
recordDetail :: Sim -> StepKind -> IO ()
recordDetail sim kind = when (detailedSteps (options sim)) (recordStep sim kind)
{-# INLINE recordDetail #-}

-- | Records that the task that has the turn receives the exception. (The text of a stop request is made here: a
-- run that is kept would otherwise keep the threads that were stopped. A user's exception may not have an end.)
recordReceived :: Sim -> SomeException -> IO ()
recordReceived sim e = case fromException e of
  Just request -> recordStep sim . ReceivesException $! show (request :: Stop)
  Nothing -> recordStep sim (ReceivesException (safeShow (show e)))
