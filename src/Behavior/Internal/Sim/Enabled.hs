{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Which tasks are enabled.
--
-- Every task that has not ended, except the one that has the turn, is in at most one of three
-- maps: 'ready', 'awaiting', 'sleepers'. It is in none of them while it waits until an exception
-- that it threw is raised. So a choice does not have to check all tasks.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Enabled
  ( file
  , unfile
  , enabled
  , possible
  , receives
  , Receives (..)
  , wakeUntil
  ) where

import Control.Exception (MaskingState (..))
import Control.Monad (filterM, unless, when)
import Data.Foldable (for_)
import Data.IORef
import qualified Data.IntMap.Strict as IntMap
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust)

import Behavior.Internal.Core.Seconds (Seconds)
import Behavior.Internal.Sim.State

-- | Puts a task into the right map, after a change of its position or of its exceptions.
file :: Sim -> Task -> IO ()
file sim task = do
  unfile sim task
  position <- readIORef (blockedAt task)
  certain <- canRaise position
  case position of
    Gone -> pure ()
    _ | certain -> intoReady
    Unstarted -> intoReady
    Before _ op -> case op of
      Transaction _ _ -> modifyIORef' (awaiting sim) (IntMap.insert (taskNumber task) task)
      Moment t -> do
        due <- possible sim op
        if due then intoReady else modifyIORef' (sleepers sim) (Map.insert (t, taskNumber task) task)
      Delivery _ _ -> possible sim op >>= \is -> when is intoReady
      Throwing _ _ -> intoReady
      AlwaysEnabled -> intoReady
 where
  intoReady = modifyIORef' (ready sim) (Map.insert (taskNumber task) task)
  -- Whether there is an exception for the task that makes it enabled in any case: if its operation has to wait, it
  -- receives the exception.
  canRaise position = do
    arrived <- isJust <$> readIORef (pendingException task)
    waiting <- not . null <$> readIORef (pending task)
    pure $ arrived || case position of
      Before MaskedInterruptible _ -> waiting
      _ -> False

-- | Removes a task from the maps, when it gets the turn or is put into another map.
unfile :: Sim -> Task -> IO ()
unfile sim task = do
  modifyIORef' (ready sim) (Map.delete (taskNumber task))
  readIORef (blockedAt task) >>= \case
    Before _ (Transaction _ _) -> modifyIORef' (awaiting sim) (IntMap.delete (taskNumber task))
    Before _ (Moment t) -> modifyIORef' (sleepers sim) (Map.delete (t, taskNumber task))
    _ -> pure ()

-- | The enabled tasks.
enabled :: Sim -> IO (Map Int Task)
enabled sim = do
  certain <- readIORef (ready sim)
  waiting <- readIORef (awaiting sim)
  enabledTasks <- filterM (canCommit . snd) (IntMap.toAscList waiting)
  pure (Map.union (Map.fromDistinctAscList enabledTasks) certain)
 where
  canCommit task =
    readIORef (blockedAt task) >>= \case
      Before _ op -> possible sim op
      _ -> pure False

-- | Whether the operation can be done now.
possible :: Sim -> Operation -> IO Bool
possible sim = \case
  AlwaysEnabled -> pure True
  Throwing _ _ -> pure True
  Moment t -> (t <=) <$> readIORef (time sim)
  Delivery _ p -> readIORef (released p)
  Transaction wouldRun look -> do
    EnabledCache looked was waited <- readIORef look
    n <- readIORef (commits sim)
    if looked == n
      then pure was
      else do
        is <- wouldRun
        is <$ writeIORef look (EnabledCache n is (waited || not is))

-- | When a task receives an exception that is thrown to it now.
data Receives
  = AtOnce
  | Later
  | -- | The task has ended.
    Never

-- | GHC's rule: a task receives an exception at once if it is unmasked, or if it is masked
-- interruptibly at an operation that has, or had, to wait. An exception that the task is already
-- to raise comes first: its handler runs masked, and the next exception waits for it. A task is
-- masked until it has begun. (A task with a pending exception has not begun to wait: it would have
-- received the exception there.)
receives :: Sim -> Task -> IO Receives
receives sim target = do
  arrived <- isJust <$> readIORef (pendingException target)
  waiting <- not . null <$> readIORef (pending target)
  readIORef (blockedAt target) >>= \case
    Gone -> pure Never
    Before Unmasked _ | not arrived -> pure AtOnce
    Before MaskedInterruptible op | not (arrived || waiting) -> do
      is <- possible sim op
      waited <- hasWaited op
      pure (if is && not waited then Later else AtOnce)
    _ -> pure Later

-- | Whether the operation is a transaction that had to wait. A thread whose transaction is woken
-- by another capability counts as blocked until it runs again, and receives an exception that is
-- thrown meanwhile. (A thread that waits at an 'Control.Concurrent.MVar', as a sleeper does, does
-- not receive it.)
hasWaited :: Operation -> IO Bool
hasWaited = \case
  Transaction _ look -> (\(EnabledCache _ _ waited) -> waited) <$> readIORef look
  _ -> pure False

-- | The virtual time has advanced to this moment: makes the sleepers that are due ready.
wakeUntil :: Sim -> Seconds -> IO ()
wakeUntil sim t = do
  (due, others) <- Map.spanAntitone ((<= t) . fst) <$> readIORef (sleepers sim)
  unless (Map.null due) $ do
    writeIORef (sleepers sim) others
    for_ (Map.elems due) $ \task -> modifyIORef' (ready sim) (Map.insert (taskNumber task) task)
