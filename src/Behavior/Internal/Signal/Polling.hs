{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Polled sensors.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Signal.Polling
  ( polling
  , staleAfter
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (evaluate, mask, throwIO)
import Control.Monad (forever, unless, when)
import Data.IORef (newIORef, readIORef, writeIORef)

import Behavior.Internal.Core.Failure (Behavior, failWith, trySynchronous)
import Behavior.Internal.Core.Seconds (period, slotAfter)
import Behavior.Internal.Seam.Runtime
import Behavior.Internal.Signal.Source

-- $setup
-- >>> import Behavior
-- >>> import qualified Behavior.Signal as Signal

-- | A sensor that must be polled: @polling seconds act@ reads it by @act@, in its own
-- thread, one reading at a time.
--
-- Readings start in slots that are at least a period apart, counted from start to start; each slot
-- has at most one. A reading that overruns its slot skips the slots that it missed.
-- An operator always decides on a reading that began after the operator did. After it has
-- stopped a branch, it decides on a reading that began after the branch had ended: so it waits for the
-- next slot.
--
-- The first reading is made at once. From then on, sensors of the same period are read
-- together: the second reading may come up to a tenth of a period late, and those after it
-- are exact (to a millisecond, even after an hour). A reading that is late for its slot,
-- because the machine is busy, does not delay later slots.
--
-- A reading that fails or faults gives no value: the operator throws the same exception. The
-- period must be at least a microsecond (otherwise an 'Control.Exception.ErrorCall' is
-- thrown); with an infinite period the sensor is read once.
--
-- >>> Signal.waitUntil (Signal.polling 5e-324 (pure True))
-- *** Exception: polling: a period is at least 0.000001 seconds, not 5.0e-324
--
-- >>> import Data.IORef
-- >>> level <- newIORef (12 :: Int)
-- >>> let batteryLevel = atomicModifyIORef' level (\n -> (n - 1, n))
-- >>> Signal.waitUntil ((< 10) <$> Signal.polling 0.001 batteryLevel)
--
-- @since 0.1.0.0
polling :: Seconds -> Behavior a -> Signal a
polling every act = Signal $ \demand -> do
  _ <- period "polling" every
  views <- newTVarIO (0 :: Int) -- how many views were taken, which gives a reading its generation
  newest <- newTVarIO Nothing -- the reading published last, and its generation
  next <- newIORef (-1 / 0) -- when the next reading may begin
  inFlight <- newTVarIO Nothing -- the slot of the reading in flight
  let readRepeatedly stopRequested = do
        t <- now
        slot <- max t <$> readIORef next
        readFrom t slot Unpublished
       where
        readFrom t due published = do
          slot <- sleepToSlot every t due
          writeIORef next $! slot + every
          when (readingTimes demand) $ atomically (writeTVar inFlight (Just slot))
          generation <- readTVarIO views
          (reading, stopWanted) <- mask $ \restore -> do
            reading <- trySynchronous (restore act)
            -- A stop request stays pending here, until the fault of the reading, if there is
            -- one, has been thrown.
            stopWanted <- stopRequested
            -- The reading is no longer needed, and may have swallowed the stop request.
            -- A fault of its cleanup is not lost.
            when stopWanted (either throwIO (const (pure ())) reading)
            pure (reading, stopWanted)
          unless stopWanted $ do
            changed <- case (published, reading) of
              -- (A view that was taken meanwhile waits for this reading, whatever its value.)
              (Published lastGeneration old, Right new) | generation == lastGeneration -> differs old new
              _ -> pure True
            when (changed || readingTimes demand) . atomically $ do
              when changed (writeTVar newest (Just (generation, reading)))
              when (readingTimes demand) (writeTVar inFlight Nothing)
            now >>= \t' -> readFrom t' (slotAfter every t' (slot + every)) $! case reading of
              _ | not changed -> published
              Left _ -> Unpublished
              Right new -> Published generation new
      differs old new = either (const True) not <$> trySynchronous (evaluate (equalFor demand old new))
  pure
    Source
      { workers = [Worker "polling" (readRepeatedly <$ when (readingTimes demand) (writeTVar inFlight Nothing))]
      , view = do
          n <- (+ 1) <$> readTVar views
          writeTVar views n
          pure . constantView $
            readTVar newest >>= \case
              Just (generation, reading) | generation >= n -> either throwSTM pure reading
              _ -> retry
      , inFlightSince = readTVar inFlight
      , names = []
      }

-- | The value that was last published for a sensor, and its generation.
data Published a = Unpublished | Published !Int a

-- | Fails the operator when a polled reading of the signal takes longer than the given
-- number of seconds (at least a microsecond).
--
-- The branch is stopped at once. A reading that cannot be interrupted delays the operator's
-- return, but not the stop of the branch. A signal that is not polled is never stale.
--
-- >>> let hangs = sleep 3600 >> pure True
-- >>> Signal.waitUntil (Signal.staleAfter 0.01 (Signal.polling 0.1 hangs))
-- *** Exception: FailedBecause "no reading of the signal within 0.01 s"
--
-- @since 0.1.0.0
staleAfter :: Seconds -> Signal a -> Signal a
staleAfter limit signal = Signal $ \demand -> do
  _ <- period "staleAfter" limit
  source <- open signal demand {readingTimes = True}
  -- Odd while a reading is overdue; it is incremented when a reading becomes overdue, and when
  -- it no longer is. So a view also fails for a reading that was overdue but no longer is.
  overdue <- newTVarIO (0 :: Int)
  let watchdog = forever $ do
        since <- atomically (inFlightSince source >>= maybe retry pure)
        sleepUntil (since + limit)
        isOverdue <- atomically $ do
          still <- (== Just since) <$> inFlightSince source
          when still (modifyTVar' overdue (+ 1))
          pure still
        when isOverdue . atomically $ do
          still <- (== Just since) <$> inFlightSince source
          when still retry
          clearOverdue
      clearOverdue = modifyTVar' overdue (\n -> if odd n then n + 1 else n)
      orTooLate before value = do
        n <- readTVar overdue
        when (odd n || n > before) . failWith $
          "no reading of the signal within " ++ show limit ++ " s"
        value
  pure
    source
      { workers = Worker "staleAfter" (const watchdog <$ clearOverdue) : workers source
      , view = mapView . orTooLate <$> readTVar overdue <*> view source
      }
