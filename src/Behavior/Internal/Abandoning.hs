{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Going on without a behaviour that does not stop.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Abandoning
  ( abandoning
  , abandonedCount
  , Abandoned (..)
  ) where

import Control.Exception (Exception (..), SomeException, mask, onException)
import Control.Monad (unless, void)
import Data.IORef (IORef, atomicModifyIORef', newIORef, readIORef)
import System.IO.Unsafe (unsafePerformIO)

import Behavior.Internal.Failure (Behavior, trySynchronous)
import Behavior.Internal.Runtime
import Behavior.Internal.Scope
import Behavior.Internal.Seconds (duration)

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
-- [Failure, fault] Of the behaviour: thrown, also while it is being stopped.
-- [Cancellation] Requests the behaviour's stop. If the behaviour ends in time, all is as in any
--   operator. Otherwise the cancellation goes on, and what the behaviour returns or throws later is
--   reported, but has no effect. While it is awaited nothing interrupts the caller.
--
-- An 'Abandoned' reports when a behaviour is abandoned, and when it ends at last, with what. It is
-- passed to GHC's handler for uncaught exceptions, which prints it to @stderr@ unless
-- 'GHC.Conc.setUncaughtExceptionHandler' has set another. (In a simulation it is in the record of the run.)
-- Until then the behaviour is counted ('abandonedCount'), and its thread remains, with two that wait for it.
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
  -- Masked, so that no exception comes before the handler is in place: without it 'structured' would
  -- wait for the branch.
  structured $ \scope -> mask $ \restore -> do
    acting <- branch scope (Label "abandoning" "branch") act
    restore (outcomeToIO <$> awaitOutcome acting) `onException` stopWithin limit scope acting

-- | Requests the stop of the branch, and waits for it; when the time is up, takes it out of the scope.
stopWithin :: Seconds -> Scope -> Branch a -> IO ()
stopWithin limit scope acting = do
  requestStopAsync [SomeBranch acting]
  clock <- branch scope (Label "abandoning" "clock") (sleep limit)
  -- The branch is read first: one that has ended is not abandoned.
  ended <- awaitUninterruptibly . atomically $
    tryReadOutcomeSTM acting >>= maybe (False <$ outcome clock) (const (pure True))
  unless ended $ do
    forget scope acting
    count 1
    -- (It is counted off even if the end of a simulation comes before the watcher's first step.)
    void (startWith Inherited (const (count (-1))) pure (Label "abandoning" "watcher") watch)
 where
  watch = do
    report (StillRuns limit)
    awaitOutcome acting >>= report . HasEnded . \case
      Completed _ -> Nothing
      Stopped _ -> Nothing
      Failing e -> Just e
      Faulted e -> Just e
  -- (What the users' handler throws must not end the watcher.)
  report = void . trySynchronous . reportUncaught

-- | What is reported of a behaviour that was abandoned. It is never thrown.
--
-- @since 0.1.0.0
data Abandoned
  = -- | It was abandoned: it has not ended that many seconds after its stop was requested.
    StillRuns Seconds
  | -- | It has ended now; with a failure or fault, if it has thrown one.
    HasEnded (Maybe SomeException)

instance Show Abandoned where
  show = \case
    StillRuns limit -> "abandoning: a behaviour that has not ended " ++ show limit ++ " s after its stop was requested is abandoned, and still runs"
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
abandonedCount = readIORef abandonedNow

count :: Int -> IO ()
count n = atomicModifyIORef' abandonedNow (\before -> (before + n, ()))

abandonedNow :: IORef Int
abandonedNow = unsafePerformIO (newIORef 0)
{-# NOINLINE abandonedNow #-}
