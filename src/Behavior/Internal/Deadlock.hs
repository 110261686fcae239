{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE MagicHash #-}
{-# LANGUAGE UnboxedTuples #-}

-- |
-- To wait for threads, uninterruptibly, but not for one that waits for the caller: a cleanup
-- that throws to the caller (@throwTo@ returns when its target has received the exception).
--
-- GHC does not say which thread a @throwTo@ is for. So when a thread that is waited for is
-- blocked in a @throwTo@, or waits here for one that is, the caller can be interrupted until
-- it has received one exception. Everything else that is thrown to it stays pending, as with
-- any thread that cannot be interrupted: two time limits that expire meanwhile are in GHC's
-- own queue, from which the outer one withdraws the inner one.
--
-- A thread of its own looks every 10 ms, for as long as a thread waits here.
module Behavior.Internal.Deadlock
  ( awaitUnlessAwaited
  , isDeadlock
  ) where

import Control.Concurrent (ThreadId, forkIO, myThreadId, threadDelay)
import Control.Concurrent.STM (STM, TVar)
import qualified Control.Concurrent.STM as STM
import Control.Exception
import Control.Monad (unless, void, when)
import Data.Foldable (for_)
import Data.IORef (IORef, atomicModifyIORef', newIORef, readIORef, writeIORef)
import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import qualified Data.Map.Strict as Map
import Data.Maybe (catMaybes)
import GHC.Base (IO (..), mkWeakNoFinalizer#)
import GHC.Conc (BlockReason (..), TVar (..), ThreadStatus (..), labelThread, threadStatus)
import GHC.Weak (Weak (..), deRefWeak)
import System.IO.Unsafe (unsafePerformIO)

-- | A thread that waits, for which threads, and whether it can be interrupted.
data Waiter = Waiter
  { waiting :: !ThreadId
  , awaited :: [ThreadId]
  , throwing :: !(IORef [Bool])
  -- ^ Which of those that it waits for were blocked in a @throwTo@ at the last look.
  , interruptible' :: !(TVar Bool)
  }

-- | All that wait; the number of the next; and whether there is a thread that looks.
--
-- The references are weak: otherwise GHC would find none of them deadlocked, and would not
-- throw to a cleanup that waits for what never comes.
data Waiters = Waiters !(IntMap (Weak Waiter)) !Int !Bool

waiters :: IORef Waiters
waiters = unsafePerformIO (newIORef (Waiters IntMap.empty 0 False))
{-# NOINLINE waiters #-}

-- | Waits for a transaction that comes when these threads have ended. Gives what the caller
-- has received meanwhile, the latest first. Call it masked.
awaitUnlessAwaited :: [ThreadId] -> STM a -> IO ([SomeException], a)
awaitUnlessAwaited threads transaction = do
  self <- myThreadId
  window <- STM.newTVarIO False
  n <- newIORef [] >>= \none -> register (Waiter self threads none window)
  let await received =
        uninterruptibly ((Just <$> transaction) `STM.orElse` (Nothing <$ (STM.readTVar window >>= STM.check))) >>= \case
          Just a -> pure (received, a)
          Nothing ->
            try (STM.atomically ((Just <$> transaction) `STM.orElse` (Nothing <$ (STM.readTVar window >>= STM.check . not)))) >>= \case
              Right (Just a) -> pure (received, a)
              Right Nothing -> await received
              Left e -> do
                STM.atomically (STM.writeTVar window False)
                deadlocked <- isDeadlock e
                await (if deadlocked then received else e : received)
  await [] <* unregister n

-- | Whether GHC threw it because the thread waits for what will never come.
isDeadlock :: SomeException -> IO Bool
isDeadlock e = either undefinedOne id <$> try (evaluate isOne)
 where
  isOne = case (fromException e, fromException e) of
    (Just BlockedIndefinitelyOnSTM, _) -> True
    (_, Just BlockedIndefinitelyOnMVar) -> True
    _ -> False
  undefinedOne :: SomeException -> Bool
  undefinedOne _ = False

-- | Goes on when GHC takes the thread for deadlocked: it does so, too, while the cleanup that
-- the thread waits for handles the same exception.
uninterruptibly :: STM a -> IO a
uninterruptibly transaction = uninterruptibleMask_ again
 where
  again = try (STM.atomically transaction) >>= either (\BlockedIndefinitelyOnSTM -> again) pure

register :: Waiter -> IO Int
register waiter = do
  weak <- weakly waiter
  (n, looks) <- atomicModifyIORef' waiters $ \(Waiters all' n looks) ->
    (Waiters (IntMap.insert n weak all') (n + 1) True, (n, looks))
  unless looks . void . mask_ . forkIO $ do
    self <- myThreadId
    labelThread self "deadlock: looks"
    look
  pure n

unregister :: Int -> IO ()
unregister n = atomicModifyIORef' waiters (\(Waiters all' next looks) -> (Waiters (IntMap.delete n all') next looks, ()))

-- | Alive for as long as its variable is, which only the waiting thread holds.
weakly :: Waiter -> IO (Weak Waiter)
weakly waiter@Waiter {interruptible' = TVar variable} =
  IO $ \s -> case mkWeakNoFinalizer# variable waiter s of (# s', weak #) -> (# s', Weak weak #)

-- | Looks for as long as a thread waits. One counts as blocked in a @throwTo@ when it was so
-- in two looks in a row: most are for an instant only.
--
-- (From one look to the next this holds on to no thread.)
look :: IO ()
look = do
  threadDelay 10000
  goesOn <- atomicModifyIORef' waiters $ \(Waiters all' next _) ->
    let some = not (IntMap.null all') in (Waiters all' next some, some)
  when goesOn $ do
    Waiters all' _ _ <- readIORef waiters
    alive <- catMaybes <$> traverse deRefWeak (IntMap.elems all')
    blocked <- Map.fromList <$> traverse (\w -> (,) (waiting w) . (,) (awaited w) <$> awaitsThrower w) alive
    let isStuck thread = maybe False (\(others, one) -> one || any isStuck others) (Map.lookup thread blocked)
    for_ alive $ \w -> STM.atomically (STM.writeTVar (interruptible' w) (isStuck (waiting w)))
    look

-- | Whether one of those that it waits for is blocked in a @throwTo@, and was before.
awaitsThrower :: Waiter -> IO Bool
awaitsThrower w = do
  before <- readIORef (throwing w)
  current <- traverse (fmap (== ThreadBlocked BlockedOnException) . threadStatus) (awaited w)
  or (zipWith (&&) before current) <$ (writeIORef (throwing w) $! foldr seq current current)
