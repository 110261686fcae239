{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Exceptions that are thrown from one task to another, and raised where GHC raises them.
--
-- If the target can receive the exception where it is blocked, the target itself raises it, in
-- its next turn. Otherwise the exception is put into GHC's own queue: a real thread, the helper
-- thread, is blocked in a real 'throwTo'. So GHC raises it exactly when the target unmasks, and
-- in GHC's order. The helper thread is on the same capability, where GHC wakes it as it raises
-- the exception. No other thread changes the helper thread's state meanwhile, so that reading
-- its state is no race.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Pending
  ( throwAt
  , withdraw
  , withdrawAll
  , settle
  , receive
  ) where

import Control.Concurrent
import Control.Exception
import Control.Monad (unless, when)
import Data.Foldable (for_)
import Data.IORef
import qualified Data.Map.Strict as Map
import GHC.Conc (BlockReason (..), ThreadStatus (..), threadStatus)
import GHC.IO (unsafeUnmask)

import Behavior.Internal.Sim.Enabled
import Behavior.Internal.Sim.State

-- | Throws to a task, now. The result: the pending exception, if the task cannot receive it
-- where it is blocked.
throwAt :: Sim -> Maybe Task -> Task -> SomeException -> IO (Maybe Pending)
throwAt sim from target e = do
  how <- receives sim target
  case how of
    Never -> pure Nothing
    AtOnce -> do
      writeIORef (pendingException target) (Just e)
      -- If the target itself waits in a 'throwTo', this ends that 'throwTo'.
      here <- readIORef (blockedAt target)
      case here of
        Before _ (Delivery further p) -> withdraw sim further p
        _ -> pure ()
      Nothing <$ file sim target
    Later -> do
      p <- pend
      modifyIORef' (pending target) (p :)
      Just p <$ file sim target
 where
  pend = do
    thread <- maybe (throwIO (ErrorCall "unreachable")) pure (taskThread target)
    free <- newIORef False
    helping <- mask_ $ forkOnWithUnmask (capability sim) (\unmask -> unmask (throwTo thread e))
    untilBlocked helping
    pure Pending {throwingThread = helping, thrown = e, released = free, sender = from}
  untilBlocked helping = do
    status <- threadStatus helping
    unless (isBlocked status || isOver status) (yield >> untilBlocked helping)

isBlocked, isOver :: ThreadStatus -> Bool
isBlocked = (== ThreadBlocked BlockedOnException)
isOver status = status `elem` [ThreadFinished, ThreadDied]

-- | Withdraws an exception that is pending for the target.
withdraw :: Sim -> Task -> Pending -> IO ()
withdraw sim target p = do
  done <- readIORef (released p)
  unless done $ do
    uninterruptibleMask_ (release p)
    modifyIORef' (pending target) (filter ((/= throwingThread p) . throwingThread))
    -- The target may have been ready only because of this exception.
    was <- Map.member (taskNumber target) <$> readIORef (ready sim)
    when was (file sim target)

-- | Withdraws all exceptions that are pending for the target: the target, or the run, has ended.
withdrawAll :: Sim -> Task -> IO ()
withdrawAll sim target = do
  waiting <- readIORef (pending target)
  writeIORef (pending target) []
  for_ waiting $ \p -> release p >> wakeSender sim p

-- | Ends the helper thread, and returns when it has ended.
release :: Pending -> IO ()
release p = do
  writeIORef (released p) True
  killThread (throwingThread p)
  untilOver p

untilOver :: Pending -> IO ()
untilOver p = threadStatus (throwingThread p) >>= \status -> unless (isOver status) (yield >> untilOver p)

wakeSender :: Sim -> Pending -> IO ()
wakeSender sim p = for_ (sender p) (file sim)

-- | Records the exceptions that GHC has raised in the running task since the last call.
settle :: Sim -> IO ()
settle sim = do
  me <- readIORef (current sim)
  waiting <- readIORef (pending me)
  unless (null waiting) (settlePending sim me waiting)
{-# INLINE settle #-}

settlePending :: Sim -> Task -> [Pending] -> IO ()
settlePending sim me waiting = do
  (still, gone) <- partitionM (fmap isBlocked . threadStatus . throwingThread) waiting
  writeIORef (pending me) still
  for_ gone $ \p -> do
    untilOver p
    writeIORef (released p) True
    recordReceived sim (thrown p)
    wakeSender sim p
 where
  partitionM test list = do
    tested <- traverse (\x -> (,) x <$> test x) list
    pure ([x | (x, True) <- tested], [x | (x, False) <- tested])

-- | The task is about to wait interruptibly: raises an exception that is pending.
receive :: IO ()
receive = unsafeUnmask (pure ())
