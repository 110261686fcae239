{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Signals that ignore changes which are brief, small or too frequent; that count changes; or that judge the age of
-- a value.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Signal.Filter
  ( debounce
  , throttle
  , hysteresis
  , changes
  , olderThan
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (ErrorCall (..), SomeException, throwIO)
import Control.Monad (forever, unless, when)

import Behavior.Internal.Core.Seconds (duration, moment)
import Behavior.Internal.Seam.Runtime
import Behavior.Internal.Signal.Source
import Behavior.Internal.Spans.Observer (Reading)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Sim (simulate)
-- >>> import qualified Behavior.Signal as Signal
-- >>> import Behavior.STM (atomically, newTVarIO, readTVar, writeTVar)
-- >>> import Behavior.Time (sleepForever)

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
            ++ [ Worker "debounce" (reset >> const . trackChanges . keeping <$> view source)
               , Worker "debounce clock" (pure (const promoteAfterDelay))
               ]
      , view = showingKept settled <$> view source
      }

-- | Limits the rate of changes: the first value counts at once, and so does each change, unless the
-- last one that counted was less than the given number of seconds ago (zero or more). Then the signal keeps
-- its value until that time has passed, and takes the one that is then the latest.
--
-- So two changes of the signal are at least that far apart, and the last one always comes. After a time when
-- it was not watched (as during a recovery), it begins afresh, as 'debounce' does. It bounds how often an
-- operator restarts its branch:
--
-- > planner ||| Signal.switch (Signal.throttle 5 path) fly
--
-- >>> Signal.waitUntil (Signal.throttle 0.5 (pure True))
--
-- @since 0.1.0.0
throttle :: Eq a => Seconds -> Signal a -> Signal a
throttle seconds signal = Signal $ \demand -> do
  _ <- duration "throttle" seconds
  source <- open (suppressEqual signal) demand
  passed <- newTVarIO Nothing
  let passOn value = forever $ do
        atomically $ do
          new <- Just <$> value
          old <- readTVar passed
          check (new /= old)
          writeTVar passed new
        sleep seconds
  pure
    source
      { workers =
          workers source
            ++ [Worker "throttle" (writeTVar passed Nothing >> const . passOn . keeping <$> view source)]
      , view = showingKept passed <$> view source
      }

-- | Whether the time that the signal gives (on the clock of 'Behavior.Time.now') is at least the given
-- number of seconds ago (zero or more): how to require that a reading is not too old.
--
-- > Signal.whileHolding (not \<$\> Signal.olderThan 0.5 (stamp \<$\> scan)) drive
--
-- The driver must store each reading together with its time; for a polled sensor write
-- @polling 0.1 ((,) \<$\> now \<*\> readScan)@. If a time is earlier than the one before it, the condition can
-- become true late, by up to the difference. A time that is NaN is a fault. Unlike 'staleAfter' this
-- gives a condition, works with every signal, and judges the last reading, not one that is in flight.
--
-- >>> stamp <- now
-- >>> Signal.waitUntil (Signal.olderThan 0.01 (pure stamp))
--
-- @since 0.1.0.0
olderThan :: Seconds -> Signal Seconds -> Signal Bool
olderThan seconds signal = Signal $ \demand -> do
  _ <- duration "olderThan" seconds
  source <- open (suppressEqual signal) everyValue {readingTimes = readingTimes demand}
  judged <- newTVarIO Nothing -- a time, and whether it is too old
  let judge value = forever $ do
        time <- atomically $ do
          v <- value
          known <- readTVar judged
          v <$ check (fmap fst known /= Just v)
        end <- moment "olderThan" (time + seconds)
        t <- now
        atomically (writeTVar judged (Just (time, end <= t)))
      expire = forever $ do
        time <- atomically $
          readTVar judged >>= \case
            Just (time, False) -> pure time
            _ -> retry
        sleepUntil (time + seconds)
        -- (A newer time, if there is one, is then judged again.)
        atomically (writeTVar judged (Just (time, True)))
      judgement value = do
        v <- value
        readTVar judged >>= \case
          Just (time, tooOld) | v == time -> pure tooOld
          _ -> retry
  pure
    source
      { workers =
          workers source
            ++ [ Worker "olderThan" (writeTVar judged Nothing >> const . judge . ignoreErrors <$> view source)
               , Worker "olderThan clock" (pure (const expire))
               ]
      , view = mapView judgement <$> view source
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
-- True means that the value is /high/. That a battery is low (from 20 % down, and then until it has 80 %)
-- is therefore the negation, and @initial@ is negated, too:
--
-- > low = not \<$> Signal.hysteresis True 20 80 level     -- not: Signal.hysteresis False 20 80 level
--
-- >>> battery <- newTVarIO (50 :: Int)
-- >>> let low = not <$> Signal.hysteresis True 20 80 (Signal.watching (readTVar battery))
-- >>> let shown = Signal.switch low (\isLow -> putStrLn (if isLow then "low" else "not low") >> sleepForever)
-- >>> let levels = sequence_ [sleep 1 >> atomically (writeTVar battery n) | n <- [21, 20, 79, 80, 21]]
-- >>> _ <- simulate (levels ||| shown)
-- not low
-- low
-- not low
--
-- @since 0.1.0.0
hysteresis :: Ord a => Bool -> a -> a -> Signal a -> Signal Bool
hysteresis initial low high signal = Signal $ \demand -> do
  unless (low <= high) . throwIO . ErrorCall $
    "hysteresis: the lower threshold must be at most the upper one"
  open (accumulate "hysteresis" initial (\before v -> v >= high || (before && v > low)) signal) demand

-- | How often the signal has changed since the operator began: 0 at first. A signal that is true for
-- an instant is easily missed; that it has changed stays visible here.
--
-- > waitUntil ((> 0) \<$\> changes s)     -- waits for a change from now on
--
-- A change that is undone before it is seen is not counted; all changes while the signal is not watched
-- (as during a recovery) count as one, or none. Like the memory of 'hysteresis', the count lasts for
-- the operator's whole run.
--
-- >>> goal <- newTVarIO "kitchen"
-- >>> let next = sleep 0.01 >> atomically (writeTVar goal "garden")
-- >>> Signal.waitUntil ((> 0) <$> Signal.changes (Signal.watching (readTVar goal))) `both` next
--
-- @since 0.1.0.0
changes :: Eq a => Signal a -> Signal Int
changes signal = maybe 0 snd <$> accumulate "changes" Nothing (\before -> Just . next before) signal
 where
  next Nothing v = (v, 0)
  next (Just (old, n)) v
    | v == old = (old, n)
    | otherwise = (,) v $! n + 1

-- | The state that each value of the signal leads to, from the state before it. The memory lasts for
-- the operator's whole run.
accumulate :: (Eq a, Eq s) => String -> s -> (s -> a -> s) -> Signal a -> Signal s
accumulate name initial next signal = Signal $ \demand -> do
  source <- open (suppressEqual signal) everyValue {readingTimes = readingTimes demand}
  memory <- newTVarIO initial
  let state value = do
        v <- value
        before <- readTVar memory
        let after = next before v
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
      { workers = workers source ++ [Worker name (const . remember . ignoreErrors <$> view source)]
      , view = mapView state <$> view source
      }

-- | A value that a filter keeps, and its readings, from the same transaction. The readings do not count when
-- two kept values are compared.
data Kept a = Kept {kept :: a, keptReadings :: [Reading]}

instance Eq a => Eq (Kept a) where
  a == b = kept a == kept b

-- | How a worker reads the values that it keeps.
keeping :: View a -> STM (Kept a)
keeping seen = ignoreErrors seen >>= \a -> Kept a <$> readings seen

-- | The view that shows what a filter keeps. The source is read too, so that what it throws is thrown.
--
-- (In nested filters, each reads all those inside it, and a change of one wakes the threads of all those around
-- it: at depth n, n changes wake up to n threads, which read up to n variables.)
showingKept :: TVar (Maybe (Kept a)) -> View a -> View a
showingKept variable seen = (mapView (*> (kept <$> value)) seen) {namedValues = Just (keptReadings <$> value)}
 where
  value = readTVar variable >>= maybe retry pure

-- | The first read, for workers, which only wait for values. They ignore what it throws: the operator
-- reads the value itself, and throws it.
ignoreErrors :: View a -> STM a
ignoreErrors v = firstRead v `catchSTM` \(_ :: SomeException) -> retry
