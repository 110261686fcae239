{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What a simulation is made of.
--
-- Each simulated thread is a real one, a 'Task', that runs only while it has the turn
-- and otherwise waits at a gate of its own. Only who has the turn touches the state of the
-- simulation, so that needs no locks.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.State
  ( -- * Simulations
    Sim (..)
  , newSim
  , endRun

    -- * Tasks
  , Task (..)
  , Position (..)
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

import Behavior.Internal.Runtime.Backend
import Behavior.Internal.Seconds (Seconds)
import Behavior.Internal.Sim.Policy
import Behavior.Internal.Sim.Types

-- | A simulation.
data Sim = Sim
  { options :: !Options
  , policyOf :: !Policy
  , capability :: !Int
  -- ^ All tasks are on one, so that handing the turn on is cheap.
  , current :: !(IORef Task)
  -- ^ Who has the turn.
  , tasks :: !(IORef (IntMap Task))
  -- ^ Those that have not ended.
  , threads :: !(IORef (Map ThreadId Task))
  -- ^ The same, but for messengers, by their threads.
  , ready :: !(IORef (Map Int Task))
  -- ^ Those that can use the turn, and still can when others have had it.
  , awaiting :: !(IORef (IntMap Task))
  -- ^ Those at a transaction, which others may make possible or impossible.
  , sleepers :: !(IORef (Map (Seconds, Int) Task))
  -- ^ Those that sleep, by the moment at which they are due.
  , nextNumber :: !(IORef Int)
  , time :: !(IORef Seconds)
  , counter :: !(IORef Int)
  -- ^ The number of the scheduling point.
  , nextDecisionAt :: !(IORef Int)
  -- ^ Up to this point, who has the turn keeps it as long as it can go on.
  , rotateAt :: !(IORef Int)
  -- ^ At this point another has to have its turn.
  , timeMovedAt :: !(IORef Int)
  -- ^ At this point the time moved last.
  , commits :: !(IORef Int)
  -- ^ How many transactions were run: what a waiting one sees may have changed.
  , deviations :: !(IORef [(Int, Int)])
  -- ^ The decisions that were not the usual ones, the latest first.
  , history :: !(IORef [Step])
  -- ^ The latest first.
  , runEnd :: !(MVar (Maybe (Outcome Void)))
  -- ^ How the run ended. Nothing: as the behaviour did. The thread that puts it has no turn
  -- any more.
  , unwinding :: !(IORef Bool)
  -- ^ The run has ended; now its tasks are.
  , driverRuns :: !(IORef Bool)
  -- ^ The driver has the turn, and lends it to one task after the other.
  , driverTurn :: !(MVar ())
  -- ^ The driver gets the turn back.
  , unwindAttempts :: !(IORef Int)
  -- ^ How many operations the task that is being unwound has tried.
  , responded :: !(IORef Bool)
  -- ^ Whether the capability has run what the watchdog put into its queue last.
  }

-- | A simulated thread; or a messenger, which has no thread and only throws.
data Task = Task
  { taskNumber :: !Int
  , taskLabel :: !Label
  , taskThread :: !(Maybe ThreadId)
  , gate :: !(MVar ())
  , blockedAt :: !(IORef Position)
  , pendingException :: !(IORef (Maybe SomeException))
  -- ^ What was thrown to it where it could receive it; it raises that when it has the turn.
  , pending :: !(IORef [Pending])
  -- ^ What was thrown to it where it could not, the newest first.
  , parent :: !Int
  }

-- | Where a task stands while it does not have the turn.
data Position
  = Unstarted
  | Before !MaskingState !Operation
  | Gone

-- | What a task is about to do, as far as it matters to whether it can.
data Operation
  = AlwaysEnabled
  | Transaction (IO Bool) !(IORef EnabledCache)
  | Moment !Seconds
  | -- | A messenger is about to throw.
    Throwing !Task SomeException
  | -- | What it has thrown is pending.
    Delivery !Task !Pending

-- | An exception that GHC itself will raise in its target, as soon as that unmasks: a real
-- thread, on the capability of all tasks, is blocked in a real 'throwTo'.
data Pending = Pending
  { throwingThread :: !ThreadId
  , thrown :: SomeException
  , released :: !(IORef Bool)
  -- ^ Whether it was raised or withdrawn, or its target has ended.
  , sender :: !(Maybe Task)
  -- ^ The task that waits for it to be raised; a messenger does not.
  }

-- | Whether a transaction would have run, when so many had been run; and whether it ever
-- would not have: then its task has begun to wait.
data EnabledCache = EnabledCache !Int !Bool !Bool

-- | What unwinds a task when the run has ended.
data Unwind = Unwind

instance Show Unwind where
  show Unwind = "Unwind: the simulation has ended"

instance Exception Unwind where
  toException = asyncExceptionToException
  fromException = asyncExceptionFromException

-- | A simulation without tasks, on the caller's capability.
newSim :: Options -> Policy -> IO Sim
newSim o p = do
  (here, _) <- threadCapability =<< myThreadId
  firstAsk <- askAt p
  box <- newEmptyMVar
  nowhere <- newIORef Unstarted
  nothing <- newIORef Nothing
  none <- newIORef []
  let noTask = Task (-1) (Label "nobody" "") Nothing box nowhere nothing none (-1)
  Sim o p here
    <$> newIORef noTask
    <*> newIORef IntMap.empty
    <*> newIORef Map.empty
    <*> newIORef Map.empty
    <*> newIORef IntMap.empty
    <*> newIORef Map.empty
    <*> newIORef 0
    <*> newIORef 0
    <*> newIORef 0
    <*> newIORef (min firstAsk turnLimit)
    <*> newIORef turnLimit
    <*> newIORef 0
    <*> newIORef 0
    <*> newIORef []
    <*> newIORef []
    <*> newEmptyMVar
    <*> newIORef False
    <*> newIORef False
    <*> newEmptyMVar
    <*> newIORef 0
    <*> newIORef True

-- | For so many points one task may go on in the undisturbed schedule.
turnLimit :: Int
turnLimit = 1000

-- | Ends the run. If somebody else has ended it meanwhile, the turn goes to the driver.
endRun :: Sim -> Maybe (Outcome Void) -> IO ()
endRun sim verdict = do
  first <- tryPutMVar (runEnd sim) verdict
  unless first (putMVar (driverTurn sim) ())

-- | Each decision has a number of its own.
tick :: Sim -> IO Int
tick sim = do
  n <- (+ 1) <$> readIORef (counter sim)
  writeIORef (counter sim) $! n
  pure n
{-# INLINE tick #-}

-- | A transaction was run: what others wait for may have changed.
committed :: Sim -> IO ()
committed sim = do
  n <- readIORef (commits sim)
  writeIORef (commits sim) $! n + 1

-- | Puts what the task that has the turn did on record.
recordStep :: Sim -> StepKind -> IO ()
recordStep sim what' = do
  me <- readIORef (current sim)
  t <- readIORef (time sim)
  n <- readIORef (counter sim)
  modifyIORef' (history sim) (Step t n (taskNumber me) (taskLabel me) (parent me) what' :)

-- | Likewise, if the record is to be detailed.
recordDetail :: Sim -> StepKind -> IO ()
recordDetail sim what' = when (detailed (options sim)) (recordStep sim what')
{-# INLINE recordDetail #-}
