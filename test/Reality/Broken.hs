{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE RankNTypes #-}

-- |
-- A simulator that is wrong: an exception that a thread cannot receive where it is thrown is
-- not raised where that unmasks, but when its sender next has the turn and the thread is at an
-- operation. (This was the rule once.)
module Reality.Broken
  ( late
  ) where

import Control.Concurrent (ThreadId, myThreadId)
import Control.Concurrent.STM (TVar, atomically, check, modifyTVar', newTVarIO, readTVar, readTVarIO)
import Control.Exception (MaskingState (..), SomeException (..), catch, getMaskingState, uninterruptibleMask_)
import Control.Monad (void, when)
import Data.Set (Set)
import qualified Data.Set as Set

import Behavior.Internal.Runtime.Backend
import Behavior.Internal.Runtime.Dispatch (simulator, withBackend)

-- | Runs a behaviour by the wrong rule, if it runs in a simulation.
late :: IO a -> IO a
late act =
  simulator >>= \case
    Nothing -> act
    Just s -> newTVarIO Set.empty >>= \shut -> withBackend (-1) (lately s shut) act

-- | The threads in the set cannot be interrupted; each says so at its operations.
lately :: Simulator -> TVar (Set ThreadId) -> Simulator
lately s shut =
  s
    { spawn = \label body publish ->
        after (spawn s label (\begin unmask -> body (after begin) unmask <* after (pure ())) publish)
    , deliver = throws
    , send = \target e -> do
        waits <- Set.member target <$> readTVarIO shut
        if waits
          then void (spawn s (Label "interrupt" "helper") (\_ _ -> thatEnds (uninterruptibleMask_ (throws target e))) pure)
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
    waits <- Set.member target . Set.delete self <$> readTVarIO shut
    when waits (transact s (readTVar shut >>= check . Set.notMember target))
    after (deliver s target e)
  -- When the run has ended, what it waits for is thrown to it.
  thatEnds :: IO () -> IO ()
  thatEnds act = act `catch` \(SomeException _) -> pure ()
  after :: IO a -> IO a
  after operation = do
    self <- myThreadId
    is <- (== MaskedUninterruptible) <$> getMaskingState
    was <- Set.member self <$> readTVarIO shut
    when (is && not was) (atomically (modifyTVar' shut (Set.insert self)))
    -- Whoever waits for this is part of the simulation.
    when (was && not is) (transact s (modifyTVar' shut (Set.delete self)))
    operation
