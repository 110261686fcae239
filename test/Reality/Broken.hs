{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE RankNTypes #-}

-- |
-- A wrong simulator: an exception that finds its target masked is not raised where the target
-- unmasks, but when its sender runs next and the target is at an operation. (An earlier
-- version had this rule.)
module Reality.Broken
  ( late
  ) where

import Control.Concurrent (ThreadId, myThreadId)
import Control.Concurrent.STM (TVar, atomically, check, modifyTVar', newTVarIO, readTVar, readTVarIO)
import Control.Exception (MaskingState (..), SomeException (..), catch, getMaskingState, uninterruptibleMask_)
import Control.Monad (void, when)
import Data.Set (Set)
import qualified Data.Set as Set

import Behavior.Internal.Core.Backend
import Behavior.Internal.Core.Dispatch (simulator, withBackend)

-- | Runs a behaviour by the wrong rule, if this is a simulation.
late :: IO a -> IO a
late act =
  simulator >>= \case
    Nothing -> act
    Just s -> newTVarIO Set.empty >>= \uninterruptible -> withBackend (-1) (lately s uninterruptible) act

-- | The set contains the threads that are masked uninterruptibly; each updates it at its
-- operations.
lately :: Simulator -> TVar (Set ThreadId) -> Simulator
lately s uninterruptible =
  s
    { spawn = \label body publish ->
        after (spawn s label (\begin unmask -> body (after begin) unmask <* after (pure ())) publish)
    , deliver = throws
    , send = \target e -> do
        waits <- Set.member target <$> readTVarIO uninterruptible
        if waits
          then
            let interruption = thatEnds (uninterruptibleMask_ (throws target e))
             in void (spawn s (Label "interrupt" "helper") (\_ _ -> interruption) pure)
          else send s target e
    , transact = after . transact s
    , clock = after (clock s)
    , await = after . await s
    , pause = after (pause s)
    }
 where
  throws :: ThreadId -> SomeException -> IO ()
  throws target e = do
    self <- myThreadId
    waits <- Set.member target . Set.delete self <$> readTVarIO uninterruptible
    when waits (transact s (readTVar uninterruptible >>= check . Set.notMember target))
    after (deliver s target e)
  -- When the run has ended, an exception unwinds this thread.
  thatEnds :: IO () -> IO ()
  thatEnds act = act `catch` \(SomeException _) -> pure ()
  after :: IO a -> IO a
  after operation = do
    self <- myThreadId
    is <- (== MaskedUninterruptible) <$> getMaskingState
    was <- Set.member self <$> readTVarIO uninterruptible
    when (is && not was) (atomically (modifyTVar' uninterruptible (Set.insert self)))
    -- This can wake threads of the simulation, so it is a simulated transaction.
    when (was && not is) (transact s (modifyTVar' uninterruptible (Set.delete self)))
    operation
