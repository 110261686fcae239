{-# LANGUAGE LambdaCase #-}

-- |
-- Sensors that must be asked.
module Behavior.Internal.Sensor
  ( polling
  , staleAfter
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (throwIO)
import Control.Monad (forever, when)

import Behavior.Internal.Failure (Behavior, failWith, trySynchronous)
import Behavior.Internal.Runtime
import Behavior.Internal.Source

-- $setup
-- >>> import Behavior
-- >>> import qualified Behavior.Signal as Signal

-- | A sensor that must be asked: @polling seconds act@ reads it by @act@, in a
-- thread of its own, one reading at a time.
--
-- Readings start at slots that are so many seconds apart, counted from start to
-- start. A reading that overruns its slot skips those that it missed. What an
-- operator decides on is always a reading that began after it asked; so after a
-- branch was stopped it waits for the next slot.
--
-- A reading that fails or faults is no value: the operator throws the same. The
-- number of seconds must be more than zero (an 'Control.Exception.ErrorCall' says so).
--
-- >>> import Data.IORef
-- >>> level <- newIORef (12 :: Int)
-- >>> let batteryLevel = atomicModifyIORef' level (\n -> (n - 1, n))
-- >>> Signal.waitUntil ((< 10) <$> Signal.polling 0.001 batteryLevel)
--
-- @since 0.1.0.0
polling :: Seconds -> Behavior a -> Signal a
polling every act = Signal $ do
  _ <- period "polling" every
  nextSlot <- newTVarIO Nothing -- no reading starts before it
  started <- newTVarIO (0 :: Int) -- how many readings were started
  newest <- newTVarIO Nothing -- the newest finished reading, and its number
  underWay <- newTVarIO Nothing
  let readAt slot asked = do
        sleepUntil slot
        begun <- now
        number <- atomically $ do
          writeTVar underWay (Just begun)
          modifyTVar' started (+ 1)
          writeTVar nextSlot (Just (begun + every))
          readTVar started
        read' <- trySynchronous act
        stopping <- asked
        if stopping
          then -- The reading is not wanted any more, and may have swallowed the
          -- request to stop. A fault of its cleanup is not lost.
            either throwIO (const (pure ())) read'
          else do
            atomically (writeTVar newest (Just (number, read')) >> writeTVar underWay Nothing)
            t <- now
            readAt (slotAfter (begun + every) t) asked
      slotAfter slot t
        | slot >= t = slot
        | otherwise = slot + every * fromInteger (ceiling ((t - slot) / every))
  pure
    Source
      { workers =
          [ Worker "polling" $ do
              writeTVar underWay Nothing
              slot <- readTVar nextSlot
              pure $ \asked -> now >>= \t -> readAt (maybe t (max t) slot) asked
          ]
      , view = do
          before <- readTVar started
          pure . View $ \_ ->
            readTVar newest >>= \case
              Just (number, read') | number > before -> either throwSTM pure read'
              _ -> retry
      , reading = readTVar underWay
      }

-- | Fails the operator when a polled reading of the signal takes longer than so
-- many seconds (more than zero).
--
-- The branch is stopped at once. A reading that cannot be interrupted makes the
-- operator wait with its return, not with the stop. A signal that is not polled is
-- never stale.
--
-- >>> let hangs = sleep 3600 >> pure True
-- >>> Signal.waitUntil (Signal.staleAfter 0.01 (Signal.polling 0.1 hangs))
-- *** Exception: FailedBecause "no reading of the signal within 0.01 s"
--
-- @since 0.1.0.0
staleAfter :: Seconds -> Signal a -> Signal a
staleAfter limit signal = Signal $ do
  _ <- period "staleAfter" limit
  source <- open signal
  -- Odd while a reading is overdue, and higher whenever one has been: so a view
  -- also fails for one that is over by the time it looks.
  overdue <- newTVarIO (0 :: Int)
  let watchdog = forever $ do
        since <- atomically (reading source >>= maybe retry pure)
        sleepUntil (since + limit)
        isOverdue <- atomically $ do
          still <- (== Just since) <$> reading source
          when still (modifyTVar' overdue (+ 1))
          pure still
        when isOverdue . atomically $ do
          still <- (== Just since) <$> reading source
          when still retry
          calm
      calm = modifyTVar' overdue (\n -> if odd n then n + 1 else n)
      inTime before value = do
        n <- readTVar overdue
        when (odd n || n > before) . failWith $
          "no reading of the signal within " ++ show limit ++ " s"
        value
  pure
    source
      { workers = Worker "staleAfter" (const watchdog <$ calm) : workers source
      , view = looking . inTime <$> readTVar overdue <*> view source
      }
