{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Signals that ignore brief or small changes.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Signal.Filter
  ( debounce
  , hysteresis
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (ErrorCall (..), SomeException, throwIO)
import Control.Monad (forever, unless, when)

import Behavior.Internal.Runtime
import Behavior.Internal.Seconds (duration)
import Behavior.Internal.Signal.Source

-- $setup
-- >>> import Behavior
-- >>> import qualified Behavior.Signal as Signal

-- | A change counts only once it has lasted for the given number of seconds (zero or more);
-- until then the signal keeps its value. Its first value counts at once, and so
-- does the first one after a time when it was not watched (as during a recovery).
--
-- >>> Signal.waitUntil (Signal.debounce 0.5 (pure True))
--
-- @since 0.1.0.0
debounce :: Eq a => Seconds -> Signal a -> Signal a
debounce seconds signal = Signal $ \demand -> do
  _ <- duration "debounce" seconds
  source <- open (suppressEqual signal) demand
  settled <- newTVarIO Nothing
  pending <- newTVarIO Nothing -- a value that differs, and since when
  let trackChanges value = do
        first <- atomically value
        atomically (writeTVar settled (Just first))
        let next old = do
              new <- atomically (value >>= \v -> check (v /= old) >> pure v)
              t <- now
              atomically $ do
                isSettled <- (== Just new) <$> readTVar settled
                writeTVar pending (if isSettled then Nothing else Just (new, t))
              next new
        next first
      promoteAfterDelay = forever $ do
        candidate@(new, since) <- atomically (readTVar pending >>= maybe retry pure)
        sleepUntil (since + seconds)
        atomically $ do
          lasted <- (== Just candidate) <$> readTVar pending
          when lasted (writeTVar settled (Just new) >> writeTVar pending Nothing)
      reset = writeTVar settled Nothing >> writeTVar pending Nothing
  pure
    source
      { workers =
          workers source
            ++ [ Worker "debounce" (reset >> const . trackChanges . ignoreErrors <$> view source)
               , Worker "debounce clock" (pure (const promoteAfterDelay))
               ]
      , -- The source is read here too, so that what it throws is thrown.
        view = mapView (*> (readTVar settled >>= maybe retry pure)) <$> view source
      }

-- | A Schmitt trigger: @hysteresis initial low high signal@ becomes true when the signal
-- reaches @high@, and false when it falls to @low@; in between it keeps its value, which
-- is @initial@ at first.
--
-- The memory lasts for the operator's whole run, across recoveries, but no longer: the next
-- operator begins with @initial@. 'Behavior.Signal.withShared' around several operators makes
-- it outlive each of them.
--
-- @low@ must not be above @high@, and neither may be NaN (otherwise an 'ErrorCall' is thrown).
--
-- >>> let level = pure 50 :: Signal Int
-- >>> let charged = Signal.hysteresis True 20 80 level
-- >>> Signal.rSelect charged (pure "work") (pure "charge")
-- "work"
--
-- @since 0.1.0.0
hysteresis :: Ord a => Bool -> a -> a -> Signal a -> Signal Bool
hysteresis initial low high signal = Signal $ \demand -> do
  unless (low <= high) . throwIO . ErrorCall $
    "hysteresis: the lower threshold must be at most the upper one"
  source <- open (suppressEqual signal) everyValue {readingTimes = readingTimes demand}
  memory <- newTVarIO initial
  let state value = do
        v <- value
        before <- readTVar memory
        let after = v >= high || (before && v > low)
        when (after /= before) (writeTVar memory after)
        pure after
      -- A new state that a read computes is kept if the operator acts on it, in the same
      -- transaction, and is undone if the operator goes on waiting. In that case this
      -- thread writes it.
      remember value = forever . atomically $ do
        before <- readTVar memory
        after <- state value
        check (after /= before)
  pure
    source
      { workers = workers source ++ [Worker "hysteresis" (const . remember . ignoreErrors <$> view source)]
      , view = mapView state <$> view source
      }

-- | The first read, for workers, which only wait for values. What it throws is left to the
-- operator, which reads the value itself.
ignoreErrors :: View a -> STM a
ignoreErrors v = firstRead v `catchSTM` \(_ :: SomeException) -> retry
