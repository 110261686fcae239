{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Transactions that tasks wait for, and whether they can commit now.
--
-- Each commit may enable every task that waits; to try all their transactions again after each takes most of the time
-- of a large simulation. So a transaction that could not commit has a watcher: a real thread that is blocked in the
-- same transaction. GHC wakes it when a variable changes that the transaction has read. As long as it is blocked, the
-- transaction cannot commit. The watcher is on the capability of all tasks, where GHC wakes it as part of the commit,
-- so that reading its state is no race.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Awaited
  ( Awaited
  , awaited
  , canCommit
  , hasWaited
  , unwatch
  ) where

import Control.Concurrent
import Control.Concurrent.STM (STM, atomically, orElse, throwSTM)
import Control.Exception
import Data.Foldable (for_)
import Data.IORef
import GHC.Conc (BlockReason (..), ThreadStatus (..), threadStatus)

-- | A transaction that a task waits for.
data Awaited = Awaited
  { wouldCommit :: IO Bool
  -- ^ Tries it, and undoes what it has done.
  , watch :: IO ThreadId
  -- ^ Starts a thread that is blocked until the transaction can commit, and then ends.
  , lastTry :: !(IORef Try)
  }

-- | How its last try went.
data Try = Try
  { triedAt :: !Int
  -- ^ How many transactions had been committed before.
  , succeeded :: !Bool
  , everFailed :: !Bool
  -- ^ Whether this try failed, or one before it.
  , watcher :: !(Maybe ThreadId)
  , isWatchable :: !Bool
  -- ^ Whether no watcher of it was disturbed ('tryAgain').
  }

-- | Not tried yet. The tasks are on this capability.
awaited :: Int -> STM a -> IO Awaited
awaited onCapability act = Awaited tries blocks <$> newIORef (Try (-1) False False Nothing True)
 where
  -- (What the transaction throws is thrown where its task does it, not here.)
  tries = uninterruptibleMask_ $ atomically (undone `orElse` pure False) `catch` \(_ :: SomeException) -> pure True
  blocks = mask_ $ forkOnWithUnmask onCapability $ \unmask ->
    unmask (atomically undone) `catch` \(_ :: SomeException) -> pure ()
  undone = act >> throwSTM Undo

data Undo = Undo
  deriving (Show)

instance Exception Undo

-- | Whether it can commit now. The number is that of the transactions that have been committed.
canCommit :: Int -> Awaited -> IO Bool
canCommit n it = do
  before <- readIORef (lastTry it)
  if triedAt before == n
    then pure (succeeded before)
    else
      traverse settled (watcher before) >>= \case
        Just (ThreadBlocked BlockedOnSTM) -> pure False
        status -> tryAgain n (status == Just ThreadRunning) it

-- | The state of a watcher. If GHC has just woken it, it can look now whether the transaction can commit, and is
-- blocked again if not.
settled :: ThreadId -> IO ThreadStatus
settled thread = do
  status <- threadStatus thread
  if status == ThreadRunning then yield >> threadStatus thread else pure status

-- | Tries it, and starts a watcher if it cannot commit. But none any more, if one was disturbed: if a thread outside of
-- the simulation wakes it again and again, or the transaction has no end.
tryAgain :: Int -> Bool -> Awaited -> IO Bool
tryAgain n wasDisturbed it = do
  unwatch it
  before <- readIORef (lastTry it)
  is <- wouldCommit it
  let watchable = isWatchable before && not wasDisturbed
  new <- if is || not watchable then pure Nothing else Just <$> watch it
  is <$ writeIORef (lastTry it) (Try n is (everFailed before || not is) new watchable)

-- | Whether a task had to wait for it: it could not commit when it was tried.
hasWaited :: Awaited -> IO Bool
hasWaited it = everFailed <$> readIORef (lastTry it)

-- | Ends its watcher: no task waits for it now.
unwatch :: Awaited -> IO ()
unwatch it = do
  latest <- readIORef (lastTry it)
  for_ (watcher latest) $ \thread -> do
    writeIORef (lastTry it) latest {watcher = Nothing}
    killThread thread
