{-# OPTIONS_HADDOCK not-home #-}

-- |
-- A service beside a behaviour.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Concurrent.Service
  ( servedBy
  , betweenTurns
  ) where

import Control.Concurrent.STM (STM, check, newTVarIO, readTVar, writeTVar)
import Control.Exception (finally, uninterruptibleMask_)

import Behavior.Internal.Concurrent.Nursery (fork, scoped)
import Behavior.Internal.Concurrent.Parallel (firstOf)
import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Seam.Runtime (Seconds, atomically, sleepWithOwnTimer)

-- | Runs the behaviour beside a service, which goes on until the behaviour has ended, cleanup included: what stops a
-- robot must still reach it. (An operator requests the stop of all its branches together. So the thread of the
-- service is uninterruptible, but the branch in which the service runs is not; it is stopped when the behaviour is
-- over, and not before.) If the service fails or faults, the behaviour is stopped, and that is thrown.
servedBy :: Behavior () -> Behavior a -> Behavior a
servedBy service behavior = do
  over <- newTVarIO False
  let untilOver = firstOf [service, atomically (readTVar over >>= check)]
  scoped $ \nursery ->
    (fork nursery (uninterruptibleMask_ untilOver) >> behavior) `finally` atomically (writeTVar over True)

-- | What a service does between two turns of its work: it waits for that many seconds, or for the transaction.
betweenTurns :: Seconds -> STM () -> Behavior ()
betweenTurns seconds sooner = firstOf [sleepWithOwnTimer seconds, atomically sooner]
