{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE RankNTypes #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- The scheduler: how a simulation does the operations of its tasks.
--
-- All operations begin in 'operation', where the task that has the turn may pass it to another.
--
-- An exception that is thrown to a task is raised in place of the task's operation, if the
-- task can receive it there; otherwise GHC raises it when the task unmasks
-- ("Behavior.Internal.Sim.Pending").
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Scheduler
  ( simulation
  , launch
  ) where

import Control.Applicative ((<|>))
import Control.Concurrent
import Control.Concurrent.Async (Async, asyncOnWithUnmask, asyncThreadId)
import Control.Concurrent.STM (STM, catchSTM, orElse, throwSTM)
import qualified Control.Concurrent.STM as STM
import Control.Exception
import Control.Monad (unless, void, when)
import Data.Foldable (for_)
import Data.IORef
import qualified Data.IntMap.Strict as IntMap
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust)
import Foreign.StablePtr (newStablePtr)

import Behavior.Internal.Core.Backend
import Behavior.Internal.Core.Property (Property)
import Behavior.Internal.Sim.Coverage (canStart, starts)
import Behavior.Internal.Sim.Enabled
import Behavior.Internal.Sim.Pending
import Behavior.Internal.Sim.State
import Behavior.Internal.Sim.Turn
import Behavior.Internal.Sim.Types
import Behavior.Internal.Spans.Place (myPlace)

-- | The backend that the seam calls, for the simulation with this number, run by this property.
simulation :: Int -> Maybe Property -> Sim -> Simulator
simulation n property sim =
  Simulator
    { runNumber = n
    , propertyOf = property
    , isRunning = \self -> (== Just self) . taskThread <$> readIORef (current sim)
    , spawn = \name body publish -> do
        operation sim AlwaysEnabled
        me <- readIORef (current sim)
        reaching (starts name)
        asyncThreadId . snd <$> launch sim (taskNumber me) name body publish
    , deliver = \target e -> withTarget target $ \me there ->
        if taskNumber there == taskNumber me
          then throwTo target e
          else unlessUnwinding $ throwAt sim (Just me) there e >>= mapM_ (untilRaised there)
    , send = \target e -> withTarget target $ \me there ->
        void . enlist sim (taskNumber me) (Label "interrupt" "helper") Nothing $
          Before MaskedUninterruptible (Throwing there e)
    , transact = transaction sim
    , clock = operation sim AlwaysEnabled >> readIORef (time sim)
    , await = \moment -> do
        recordDetail sim (Sleeps moment)
        operation sim (Moment moment)
    , pause = operation sim AlwaysEnabled
    , recording = not <$> readIORef (unwinding sim)
    , lookAtClock = readIORef (time sim)
    , recordStart = settle sim >> recordStep sim Starts
    , recordNote = \text -> settle sim >> recordStep sim (Note text)
    , recordMistake = \e -> modifyIORef' (mistaken sim) (<|> Just e)
    , recordStartable = \operator branches -> reaching (canStart operator branches)
    , recordStarted = reaching . starts
    }
 where
  -- An exception for a thread that has ended is dropped.
  withTarget target act = do
    found <- Map.lookup target <$> readIORef (threads sim)
    for_ found (\there -> recordDetail sim (Throws (taskNumber there) (taskLabel there)))
    operation sim AlwaysEnabled
    me <- readIORef (current sim)
    for_ found (act me)
  reaching further = myPlace >>= \here -> modifyIORef' (reached sim) (further here)
  unlessUnwinding act = readIORef (unwinding sim) >>= \ending -> unless ending act
  -- A sender that is interrupted while it waits withdraws its exception, as in GHC's 'throwTo'.
  untilRaised there p = operation sim (Delivery there p) `onException` withdraw sim there p

-- | Starts a task and its real thread, which waits for its first turn.
launch :: Sim -> Int -> Label -> (IO () -> (forall b. IO b -> IO b) -> IO a) -> (a -> STM ()) -> IO (Task, Async ())
launch sim starter name body publish = do
  entrance <- newEmptyMVar
  thread <- mask_ $ asyncOnWithUnmask (capability sim) $ \unmask -> do
    uninterruptibleMask_ (takeMVar entrance)
    self <- readIORef (current sim)
    a <- body (arrive sim self) unmask
    uninterruptibleMask_ (leave sim self (publish a))
  task <- enlist sim starter name (Just (asyncThreadId thread, entrance)) Unstarted
  pure (task, thread)

enlist :: Sim -> Int -> Label -> Maybe (ThreadId, MVar ()) -> BlockedAt -> IO Task
enlist sim starter name thread here = do
  entrance <- maybe newEmptyMVar (pure . snd) thread
  n <- readIORef (nextNumber sim)
  writeIORef (nextNumber sim) (n + 1)
  task <- newTask n name (fst <$> thread) entrance starter here
  modifyIORef' (tasks sim) (IntMap.insert n task)
  for_ (taskThread task) $ \there -> modifyIORef' (threads sim) (Map.insert there task)
  task <$ file sim task

-- | The scheduling point before an operation. When it returns, the calling task has the
-- turn, and the operation can be done. It throws an exception that was thrown to the task.
operation :: Sim -> Operation -> IO ()
operation sim op = do
  settle sim
  quick <- keepsTurn sim
  isPossible <- if quick then possible sim op else pure False
  unless isPossible (reschedule sim op)
{-# INLINE operation #-}

-- | Counts a scheduling point. The result: whether the running task keeps the turn there, as
-- long as it is enabled.
keepsTurn :: Sim -> IO Bool
keepsTurn sim = tick sim >>= \n -> (n <) <$> readIORef (nextDecisionAt sim)
{-# INLINE keepsTurn #-}

-- | The operation that runs a transaction.
transaction :: Sim -> STM a -> IO a
transaction sim act = do
  settle sim
  recordDetail sim Transacts
  quick <- keepsTurn sim
  done <- if quick then tried else pure Nothing
  maybe (newIORef (EnabledCache (-1) False False) >>= waiting) pure done
 where
  tried = do
    result <- STM.atomically ((Just <$> act) `orElse` pure Nothing)
    when (isJust result) (committed sim)
    pure result
  waiting look = do
    reschedule sim (Transaction wouldRun look)
    -- The transaction commits now, unless something outside of the simulation has just made
    -- that impossible, or the run has ended.
    tried >>= \case
      Just a -> pure a
      Nothing -> do
        ending <- readIORef (unwinding sim)
        if ending then throwIO Unwind else waiting look
  wouldRun =
    STM.atomically $
      ((act >> throwSTM Undo) `catchSTM` \(_ :: SomeException) -> pure True) `orElse` pure False

data Undo = Undo
  deriving (Show)

instance Exception Undo

-- | Gives the turn to the task that the policy chooses, and returns in the caller's next turn.
reschedule :: Sim -> Operation -> IO ()
reschedule sim op = do
  masking <- getMaskingState
  uninterruptibleMask_ $ do
    me <- readIORef (current sim)
    ending <- readIORef (unwinding sim)
    if ending
      then operationAfterEnd sim me
      else do
        writeIORef (blockedAt me) (Before masking op)
        file sim me
        next <- choose sim (Just me)
        case next of
          Just task | taskNumber task == taskNumber me -> pure ()
          _ -> for_ next (turnTo sim) >> takeMVar (gate me)
        arrive sim me
        waiting <- readIORef (pending me)
        when (masking == MaskedInterruptible && not (null waiting)) $ do
          isPossible <- possible sim op
          unless isPossible receive

turnTo :: Sim -> Task -> IO ()
turnTo sim task = writeIORef (current sim) task >> putMVar (gate task) ()

-- | Begins the caller's turn: raises the exception that it is to receive, if there is one.
arrive :: Sim -> Task -> IO ()
arrive sim me = do
  ending <- readIORef (unwinding sim)
  if ending
    then throwIO Unwind
    else
      readIORef (pendingException me) >>= \case
        Nothing -> pure ()
        Just e -> do
          writeIORef (pendingException me) Nothing
          recordReceived sim e
          throwIO e

-- | The end of a task, which is an operation too.
leave :: Sim -> Task -> STM () -> IO ()
leave sim me publish = do
  ending <- readIORef (unwinding sim)
  unless ending $ do
    settle sim
    _ <- tick sim
    reschedule sim AlwaysEnabled `catch` \Unwind -> pure ()
  STM.atomically publish
  committed sim
  unless (taskNumber me == 0) (recordStep sim Ends)
  modifyIORef' (tasks sim) (IntMap.delete (taskNumber me))
  for_ (taskThread me) (modifyIORef' (threads sim) . Map.delete)
  writeIORef (blockedAt me) Gone
  withdrawAll sim me
  endingNow <- readIORef (unwinding sim)
  if endingNow
    then putMVar (driverTurn sim) ()
    else
      if taskNumber me == 0
        then endRun sim Nothing
        else tick sim >> choose sim Nothing >>= mapM_ (turnTo sim)

-- | An operation after the end of the run. A task that still has the turn from the run returns
-- it to the driver. A task to which the driver has given the turn keeps it until the task
-- ends: its operations are done at once, and where it would wait, it is unwound instead. A task
-- that does not end even then is blocked for ever.
operationAfterEnd :: Sim -> Task -> IO ()
operationAfterEnd sim me = do
  isDriven <- readIORef (driverRuns sim)
  if not isDriven
    then putMVar (driverTurn sim) () >> takeMVar (gate me) >> throwIO Unwind
    else do
      n <- readIORef (unwindAttempts sim)
      writeIORef (unwindAttempts sim) $! n + 1
      when (n > 20000) $ do
        -- The stable pointer keeps the gate alive. Otherwise GHC would find the thread
        -- deadlocked, and wake it with an exception.
        _ <- newStablePtr (gate me)
        modifyIORef' (tasks sim) (IntMap.delete (taskNumber me))
        putMVar (driverTurn sim) ()
        takeMVar (gate me)
      when (n > 10000) (throwIO Unwind)
