{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Going on without a behaviour that does not stop.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Concurrent.Abandoning
  ( abandoning
  , abandonedCount
  , Abandoned (..)
  ) where

import Control.Concurrent.STM (TVar, modifyTVar', newTVarIO, readTVar, readTVarIO, writeTVar)
import Control.Exception (Exception (..), SomeException, catch, mask, throwIO, try)
import Control.Monad (join, void, when)
import System.IO.Unsafe (unsafePerformIO)

import Behavior.Internal.Concurrent.Outcome (Outcome (..))
import Behavior.Internal.Concurrent.Scope
import Behavior.Internal.Core.Cause (Cause)
import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Core.Seconds (duration)
import Behavior.Internal.Core.Stop (causeOf)
import Behavior.Internal.Seam.Runtime
import Behavior.Internal.Spans.Place (inPlace)
import Behavior.Internal.Spans.Span (abandonableIn)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Time
-- >>> import Control.Exception (uninterruptibleMask_)

-- | Goes on without a behaviour that does not stop: when its stop has been requested, it is awaited
-- for the given number of seconds (zero or more), and then /abandoned/.
--
-- > abandoning (1 / 0) act  =  firstOf [act]
--
-- __This is the only way out of the promises__ that an operator returns only when what it started
-- has ended (1), that it never runs both branches (2), and that no fault is lost (4). The
-- behaviour that was abandoned goes on: a driver that hangs may move the motor an hour later, while
-- something else does. Use it where going on is the lesser evil: a camera whose driver hangs in a
-- call that nothing can interrupt must not keep the drone from landing.
--
-- > insteadWhen wind land (both fly (abandoning 2 film))
--
-- [Result] The behaviour's.
-- [Failure] Of the behaviour: thrown; but one that it throws while it is being stopped is dropped, and the
--   cancellation goes on.
-- [Fault] Of the behaviour, also while it is being stopped: thrown.
-- [Cancellation] Requests the behaviour's stop. If the behaviour ends in time, all is as in any
--   operator. Otherwise the cancellation goes on, and what the behaviour returns or throws later is
--   reported, but has no effect. While it is awaited nothing interrupts the caller.
--
-- An 'Abandoned' reports that a behaviour was abandoned; another one reports when the behaviour ends at last, and
-- how. Both are passed to GHC's handler for uncaught exceptions, which prints them to @stderr@ unless
-- 'GHC.Conc.setUncaughtExceptionHandler' has set another. (In a simulation they are in the record of the run.)
-- Until it ends, an abandoned behaviour is counted ('abandonedCount'), and occupies three threads: its own, and
-- two that wait for its end. The end of the program ends it, without a report. With zero seconds, even a behaviour
-- that would have stopped at once is abandoned.
--
-- A negative number or NaN is refused with an 'Control.Exception.ErrorCall' (a fault).
--
-- >>> timeout 0.01 (abandoning 1 (sleep 3600)) ? putStrLn "land"
-- land
--
-- @since 0.1.0.0
abandoning :: Seconds -> Behavior a -> Behavior a
abandoning seconds act = do
  limit <- duration "abandoning" seconds
  isAbandoned <- newTVarIO False
  -- The transaction that publishes its end takes it off the count.
  let countOff _ = readTVar isAbandoned >>= \is -> when is (modifyTVar' abandonedNow (subtract 1))
  -- Masked, so that no exception comes before the handler is in place: without it 'structured' would
  -- wait for the branch.
  structured "abandoning" $ \scope -> mask $ \restore -> do
    (acting, endSpans) <- abandonableIn (branchWith plainly {hook = countOff} scope "branch" (const act))
    restore (endedBy "branch" <$> awaitOutcome acting)
      `catch` \e -> stopWithin limit isAbandoned endSpans scope (causeOf e) acting >> throwIO (e :: SomeException)

-- | Requests the stop of the branch, and waits for it; when the time is up, takes it out of the scope,
-- and ends its spans.
stopWithin :: Seconds -> TVar Bool -> IO () -> Scope -> Cause -> Branch a -> IO ()
stopWithin limit isAbandoned endSpans scope cause acting = do
  requestStopAsync cause [SomeBranch acting]
  clock <- branch scope "clock" (sleep limit)
  -- The branch is read first: one that has ended is not abandoned.
  join . awaitUninterruptibly . atomically $
    tryReadOutcomeSTM acting >>= \case
      Just _ -> pure (pure ())
      Nothing -> do
        _ <- outcome clock
        writeTVar isAbandoned True
        modifyTVar' abandonedNow (+ 1)
        pure (forget scope acting >> endSpans >> void (inPlace Nothing (start (Label "abandoning" "watcher") watch)))
 where
  watch = do
    report (StillRuns limit)
    awaitUninterruptibly (awaitOutcome acting) >>= report . HasEnded . \case
      Completed _ -> Nothing
      Stopped _ -> Nothing
      FailedWith e -> Just e
      FaultedWith e -> Just e
  -- What the users' handler throws, of whatever type, must not end the watcher.
  report what = void (try (reportUncaught what) :: IO (Either SomeException ()))

-- | What is reported of a behaviour that was abandoned. It is never thrown.
--
-- @since 0.1.0.0
data Abandoned
  = -- | It was abandoned: it had not ended this number of seconds after its stop was requested.
    StillRuns Seconds
  | -- | It has ended now; with this failure or fault, if it threw one.
    HasEnded (Maybe SomeException)

instance Show Abandoned where
  show = \case
    StillRuns limit ->
      "abandoning: a behaviour that has not ended " ++ show limit
        ++ " s after its stop was requested is abandoned, and still runs"
    HasEnded Nothing -> "abandoning: a behaviour that was abandoned has ended"
    HasEnded (Just e) -> "abandoning: a behaviour that was abandoned has ended with " ++ show e

instance Exception Abandoned

-- | How many behaviours have been abandoned and have not ended yet.
--
-- >>> abandonedCount
-- 0
--
-- @since 0.1.0.0
abandonedCount :: IO Int
abandonedCount = readTVarIO abandonedNow

abandonedNow :: TVar Int
abandonedNow = unsafePerformIO (newTVarIO 0)
{-# NOINLINE abandonedNow #-}
