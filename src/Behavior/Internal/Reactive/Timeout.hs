{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Time limits.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Reactive.Timeout
  ( timeout
  , timeoutAt
  , TimedOut (..)
  , cleanupWithin
  ) where

import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
import Control.Exception (Exception (..), throwIO, uninterruptibleMask_)

import Behavior.Internal.Core.Cause (Cause (..))
import Behavior.Internal.Core.Failure
  ( Behavior
  , behaviorFailedFromException
  , behaviorFailedToException
  )
import Behavior.Internal.Core.Seconds (Seconds, duration, moment)
import Behavior.Internal.Reactive.Engine (Response (..), react)
import Behavior.Internal.Seam.Runtime (atomically, now, sleepUntil)
import Behavior.Internal.Signal.Source (Signal (..), Source (..), Worker (..), constantView, fromView)

-- $setup
-- >>> import Behavior (sleep, (?))
-- >>> import Behavior.Time (now)
-- >>> import Control.Exception (onException)

-- | Runs the behaviour for at most the given number of seconds, and fails with 'TimedOut'
-- when it takes longer.
--
-- [Result] The behaviour's. A result that exists when the time is up, or that the
--   behaviour returns although its stop was requested, is kept.
-- [Failure] 'TimedOut', or the behaviour's own.
-- [Fault] Of the behaviour, also while it is being stopped: thrown.
-- [Cancellation] Requests the behaviour's stop; returns after the behaviour has ended.
--
-- With zero seconds, the behaviour is not started. A negative number or NaN is
-- refused with an 'Control.Exception.ErrorCall' (a fault); an infinite one is no limit.
--
-- It returns when the behaviour has ended, cleanup included; so a slow cleanup
-- makes it late.
--
-- >>> timeout 0.01 (sleep 3600)
-- *** Exception: TimedOut 0.01
--
-- >>> timeout 0.01 (sleep 3600) ? putStrLn "never mind"
-- never mind
--
-- @since 0.1.0.0
timeout :: Seconds -> Behavior a -> Behavior a
timeout seconds behavior = do
  limit <- duration "timeout" seconds
  react "timeout" [False] (elapsed limit) $ \case
    True -> Conclude (Just (TimeLimit limit)) (throwIO (TimedOut limit))
    False -> Run "branch" behavior

-- | 'timeout' with a deadline, a moment on the clock of 'Behavior.Time.now', in place of a duration.
--
-- > timeoutAt end act  =  now >>= \t -> timeout (max 0 (end - t)) act
--
-- The deadline stays the same, however often the behaviour begins again. So a mission can have a limit in
-- total, its recoveries included; and within it each try has a limit of its own, with growing pauses between
-- the tries:
--
-- > do end <- (+ 60) <$> now
-- >    monitor low charge (timeoutAt end (retrying (iterate (* 2) 1) (timeout 5 deliver)))
--
-- (The limit is inside the monitor, so it cuts no recovery short. A @timeout 60@ in its place would begin again
-- with the task.)
--
-- [Result, failure, fault, cancellation] As in 'timeout'. 'TimedOut' has the number of seconds from its
--   start to the deadline.
--
-- When the deadline has passed, the behaviour is not started. NaN is refused with an
-- 'Control.Exception.ErrorCall' (a fault); an infinite deadline is none.
--
-- >>> end <- (+ 0.01) <$> now
-- >>> timeoutAt end (sleep 3600) ? putStrLn "never mind"
-- never mind
-- >>> timeoutAt end (putStrLn "once more")
-- *** Exception: TimedOut 0.0
--
-- @since 0.1.0.0
timeoutAt :: Seconds -> Behavior a -> Behavior a
timeoutAt seconds behavior = do
  end <- moment "timeoutAt" seconds
  limit <- (\t -> max 0 (end - t)) <$> now
  react "timeoutAt" [False] (reached end limit) $ \case
    True -> Conclude (Just (TimeLimit limit)) (throwIO (TimedOut limit))
    False -> Run "branch" behavior

-- | The failure of a behaviour that took longer than the given number of seconds.
--
-- @since 0.1.0.0
newtype TimedOut = TimedOut Seconds
  deriving (Eq, Show)

instance Exception TimedOut where
  toException = behaviorFailedToException
  fromException = behaviorFailedFromException
  displayException (TimedOut limit) = "timed out after " ++ show limit ++ " s"

-- | A cleanup that takes time: runs it to its end, however often the caller is cancelled meanwhile,
-- but for at most the given number of seconds.
--
-- > cleanupWithin s act  =  uninterruptibleMask_ (Just <$> timeout s act)
-- >   -- but with Nothing in place of TimedOut
--
-- Use it in an exception handler: @drive \`onException\` cleanupWithin 3 park@. In 'onException' and
-- 'Control.Exception.finally' a plain @park@ would be stopped by a second cancellation, and with
-- 'uninterruptibleMask_' nothing could stop it. Here it runs in a branch, unmasked, whatever the
-- caller's masking state. When the time is up its stop is requested; then it is still awaited.
--
-- [Result] The behaviour's; 'Nothing' when its time was up and it has stopped. So the exception that made the
--   cleanup necessary goes on.
-- [Failure, fault] Of the behaviour: thrown.
-- [Cancellation] Stays pending until it has ended.
--
-- With zero seconds, the behaviour is not started. A negative number or NaN is
-- refused with an 'Control.Exception.ErrorCall' (a fault). As with every caller that is masked
-- uninterruptibly, a behaviour that throws to its caller ('Control.Exception.throwTo') deadlocks.
--
-- >>> timeout 0.01 (sleep 3600 `onException` cleanupWithin 0.01 (putStrLn "park" >> sleep 3600)) ? putStrLn "go on"
-- park
-- go on
--
-- @since 0.1.0.0
cleanupWithin :: Seconds -> Behavior a -> Behavior (Maybe a)
cleanupWithin seconds behavior = uninterruptibleMask_ $ do
  limit <- duration "cleanupWithin" seconds
  react "cleanupWithin" [False] (elapsed limit) $ \case
    True -> Conclude (Just (TimeLimit limit)) (pure Nothing)
    False -> Run "branch" (Just <$> behavior)

-- | False until the given number of seconds has passed since the signal was opened.
elapsed :: Seconds -> Signal Bool
elapsed seconds = Signal $ \demand -> do
  deadline <- (+ seconds) <$> now
  open (reached deadline seconds) demand

-- | False until that moment. The second number is how many seconds are left.
reached :: Seconds -> Seconds -> Signal Bool
reached deadline left = Signal $ \_ -> do
  over <- newTVarIO (left <= 0)
  let clock = sleepUntil deadline >> atomically (writeTVar over True)
  pure (fromView (pure (constantView (readTVar over)))) {workers = [Worker "clock" (pure (const clock))]}
