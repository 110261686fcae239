{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Trying again after a pause, doing something periodically, and never ending.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Concurrent.Repeating
  ( retrying
  , retryingWith
  , every
  , sleepForever
  ) where

import Control.Monad (forever)

import Behavior.Internal.Core.Failure (Behavior, BehaviorFailed, fallbackWith)
import Behavior.Internal.Core.Seconds
import Behavior.Internal.Seam.Runtime (now, sleep, sleepUntil)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Sim (simulate)
-- >>> import Behavior.Time (TimedOut (..), timeout)
-- >>> import Control.Exception (fromException, throwIO, toException)
-- >>> import Control.Monad (unless)
-- >>> import Data.Maybe (isJust)

-- | Tries a behaviour, and after each failure again, with these delays in between.
--
-- > retrying []       act  =  act
-- > retrying (d : ds) act  =  act ? (sleep d >> retrying ds act)
--
-- Delays are an ordinary list:
--
-- > [1, 1, 1]                                     -- up to four times, a second apart
-- > repeat 0.5                                    -- for ever
-- > iterate (* 2) 0.1                             -- exponential: 0.1, 0.2, 0.4 ..
-- > map (min 5) (iterate (* 2) 0.1)               -- at most five seconds
-- > zipWith (*) jitter (take 6 (iterate (* 2) 1)) -- jitter: random factors, of the package random
--
-- [Result] That of the first try that succeeds.
-- [Failure] That of the last try, as it is. To give up at certain failures: 'retryingWith'.
-- [Fault, cancellation] Pass through at once.
--
-- It runs in constant space. A delay that is negative or NaN is refused when it is due, with an
-- 'Control.Exception.ErrorCall' (a fault).
--
-- >>> retrying (take 2 (iterate (* 2) 0.001)) (putStrLn "connect" >> failed)
-- connect
-- connect
-- connect
-- *** Exception: Failed
--
-- @since 0.1.0.0
retrying :: [Seconds] -> Behavior a -> Behavior a
retrying = retryingWith (\_ -> pure ())

-- | 'retrying' with a behaviour that is given each failure, before the delay: to report it, or to
-- give up by throwing it (or another exception).
--
-- > retryingWith report []       act  =  act
-- > retryingWith report (d : ds) act  =  fallbackWith act (\why -> report why >> sleep d >> retryingWith report ds act)
--
-- What that behaviour throws is thrown. The failure of the last try is thrown, and not given to it.
--
-- To try again only if it took too long:
--
-- >>> tooLong why = isJust (fromException (toException why) :: Maybe TimedOut)
-- >>> retryingWith (\why -> unless (tooLong why) (throwIO why)) [1, 1] (failWith "no such device")
-- *** Exception: FailedBecause "no such device"
--
-- @since 0.1.0.0
retryingWith :: (BehaviorFailed -> Behavior ()) -> [Seconds] -> Behavior a -> Behavior a
retryingWith report delays act = go delays
 where
  go [] = act
  go (delay : later) = fallbackWith act (\why -> report why >> sleep delay >> go later)

-- | Runs a behaviour periodically: at once, and then at each whole number of periods after that.
--
-- The starts are a period apart, and not the pauses, so they do not drift. A run is never
-- interrupted by the next: if it takes longer than the period, the starts that it has missed are
-- left out.
--
-- [Result] None: it does not end by itself.
-- [Failure, fault] Of the behaviour: ends it.
-- [Cancellation] Passes through.
--
-- The period is at least a microsecond. A smaller number, or NaN, is refused with an
-- 'Control.Exception.ErrorCall' (a fault), and nothing runs.
--
-- >>> _ <- simulate (timeout 0.25 (every 0.1 (putStrLn "steer")) ? putStrLn "arrived")
-- steer
-- steer
-- steer
-- arrived
--
-- @since 0.1.0.0
every :: Seconds -> Behavior a -> Behavior b
every seconds act = do
  interval <- period "every" seconds
  let from slot = do
        _ <- act
        t <- now
        let next = slotAfter interval t (slot + interval)
        sleepUntil next
        from next
  now >>= from

-- | A behaviour that never ends by itself: it waits until it is cancelled. It uses no processor time.
--
-- > sleepForever  =  forever (sleep (1 / 0))
--
-- Use it for a branch, or a task, that only its operator stops. (GHC may take a thread in
-- @atomically retry@ for deadlocked, and throw 'Control.Exception.BlockedIndefinitelyOnSTM' to it and to
-- the threads that wait for it; a thread in @sleepForever@ never.) A simulation in which nothing else can
-- ever run again ends with a deadlock, whose report says that this thread waits for the end of its sleep;
-- with an end time (@endingAt@ of "Behavior.Sim"), too.
--
-- >>> sleepForever ||| putStrLn "beep"
-- beep
--
-- @since 0.1.0.0
sleepForever :: Behavior a
sleepForever = forever (sleepUntil (1 / 0))
