{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- What a signal is made of.
module Behavior.Internal.Source
  ( -- * Signals
    Signal (..)
  , Source (..)
  , View (..)
  , Moment (..)
  , startWorkers
  , lost

    -- * Making them
  , watching
  , polling
  , elapsed

    -- * Refining them
  , staleAfter
  , debounce
  , hysteresis

    -- * Sharing them
  , withShared
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (ErrorCall (..), SomeException, finally, throwIO)
import Control.Monad (forever, when)
import Data.Foldable (for_)
import Data.Traversable (for)

import Behavior.Internal.Failure (Behavior, failWith, trySynchronous)
import Behavior.Internal.Runtime
import Behavior.Internal.Scope

-- $setup
-- >>> import Behavior
-- >>> import qualified Behavior.Signal as Signal

-- | A value that changes over time and can be watched.
--
-- (Functional reactive programming calls this a /behaviour/. Here a behaviour is
-- what the robot does.)
--
-- A signal is a recipe: each occurrence opens its sources anew, so that
-- @(==) \<$\> s \<*\> s@ on a polled signal @s@ asks the sensor by two threads and
-- can be false; 'withShared' opens them once for all. A signal of several sources
-- is made of the latest value of each, not of one moment. It has a value when
-- each of them has.
--
-- A change that comes and goes between two looks is not seen.
--
-- @since 0.1.0.0
newtype Signal a = Signal {open :: IO (Source a)}

instance Functor Signal where
  fmap f (Signal opening) = Signal (fmap (fmap f) opening)

instance Applicative Signal where
  pure a = Signal (pure (pure a))
  Signal f <*> Signal a = Signal ((<*>) <$> f <*> a)

-- | A signal that somebody has opened, for one run of an operator.
data Source a = Source
  { workers :: [Worker]
  -- ^ What must run while the source is looked at.
  , view :: STM (View a)
  -- ^ A view of the values that are read from this moment on.
  , reading :: STM (Maybe Seconds)
  -- ^ When the oldest reading began that is under way.
  }

instance Functor Source where
  fmap f source = source {view = fmap f <$> view source}

instance Applicative Source where
  pure a = Source {workers = [], view = pure (pure a), reading = pure Nothing}
  f <*> a =
    Source
      { workers = workers f ++ workers a
      , view = (<*>) <$> view f <*> view a
      , reading = earliest <$> reading f <*> reading a
      }
   where
    earliest (Just s) (Just t) = Just (min s t)
    earliest s Nothing = s
    earliest Nothing t = t

-- | How to look at a value. The look retries while there is none yet, and throws
-- when there is none any more.
newtype View a = View {look :: Moment -> STM a}

instance Functor View where
  fmap f = looking (fmap f)

instance Applicative View where
  pure a = View (\_ -> pure a)
  f <*> a = View (\moment -> look f moment <*> look a moment)

looking :: (STM a -> STM b) -> View a -> View b
looking f v = View (f . look v)

-- | When an operator looks.
data Moment
  = -- | For the first time: it waits for a value, however long that takes to come.
    First
  | -- | Later: a value that is not there has been lost.
    Later

-- | A thread that a source needs while it is looked at.
data Worker = Worker
  { workerName :: String
  , work :: STM (IO Bool -> IO ())
  -- ^ What to run, until it is asked to stop (it can see whether it was). A worker
  -- may be started again after a pause; the transaction prepares each start.
  }

-- | The value that a transaction gives: event-driven. It reacts to the very
-- transaction that changes the value, and costs nothing while nothing changes.
--
-- While the transaction retries at first, the operator waits for a value. If it
-- retries later the signal has no value any more, and the operator fails. What the
-- transaction throws, the operator throws.
--
-- >>> import Control.Concurrent.STM (newTVarIO, readTVar)
-- >>> battery <- newTVarIO (5 :: Int)
-- >>> Signal.waitUntil ((< 10) <$> Signal.watching (readTVar battery))
--
-- @since 0.1.0.0
watching :: STM a -> Signal a
watching transaction = Signal . pure $ (pure ()) {view = pure (View value)}
 where
  value First = transaction
  value Later = transaction `orElse` failWith "the signal has no value any more"

-- | A sensor that must be asked: @polling seconds act@ reads it by @act@, in a
-- thread of its own, one reading at a time.
--
-- Readings start at slots that are so many seconds apart, counted from start to
-- start. A reading that overruns its slot skips those that it missed. What an
-- operator decides on is always a reading that began after it asked; so after a
-- branch was stopped it waits for the next slot.
--
-- A reading that fails or faults is no value: the operator throws the same. The
-- number of seconds must be more than zero (an 'ErrorCall' says so).
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

-- | False until so many seconds have passed since it was opened.
elapsed :: Seconds -> Signal Bool
elapsed seconds = Signal $ do
  over <- newTVarIO (seconds <= 0)
  deadline <- (+ seconds) <$> now
  let clock = sleepUntil deadline >> atomically (writeTVar over True)
  pure (pure ()) {workers = [Worker "clock" (pure (const clock))], view = pure (View (\_ -> readTVar over))}

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

-- | A change counts only once it has lasted for so many seconds (zero or more);
-- until then the signal keeps its value. Its first value counts at once, and so
-- does the first after a time when nobody watched (as during a recovery).
--
-- >>> Signal.waitUntil (Signal.debounce 0.5 (pure True))
--
-- @since 0.1.0.0
debounce :: Eq a => Seconds -> Signal a -> Signal a
debounce seconds signal = Signal $ do
  _ <- duration "debounce" seconds
  source <- open signal
  settled <- newTVarIO Nothing
  pending <- newTVarIO Nothing -- a value that differs, and since when
  let noticing value = do
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
      settling = forever $ do
        candidate@(new, since) <- atomically (readTVar pending >>= maybe retry pure)
        sleepUntil (since + seconds)
        atomically $ do
          lasted <- (== Just candidate) <$> readTVar pending
          when lasted (writeTVar settled (Just new) >> writeTVar pending Nothing)
      forgetAll = writeTVar settled Nothing >> writeTVar pending Nothing
  pure
    source
      { workers =
          workers source
            ++ [ Worker "debounce" (forgetAll >> const . noticing . quietly <$> view source)
               , Worker "debounce clock" (pure (const settling))
               ]
      , -- The look at the source itself is for what it throws.
        view = looking (*> (readTVar settled >>= maybe retry pure)) <$> view source
      }

-- | @hysteresis low high signal@ becomes true when the signal reaches @high@, and
-- false when it falls to @low@; in between it keeps its value, which at first is
-- false. (A Schmitt trigger.) That memory lasts for the operator's whole run,
-- across recoveries.
--
-- @low@ must not be above @high@ (an 'ErrorCall' says so).
--
-- >>> let level = pure 50 :: Signal Int
-- >>> let charged = Signal.hysteresis 10 90 level
-- >>> Signal.rSelect charged (pure "work") (pure "charge")
-- "charge"
--
-- @since 0.1.0.0
hysteresis :: Ord a => a -> a -> Signal a -> Signal Bool
hysteresis low high signal = Signal $ do
  when (low > high) . throwIO . ErrorCall $
    "hysteresis: the lower threshold must not be above the upper one"
  source <- open signal
  memory <- newTVarIO False
  let state value = do
        v <- value
        before <- readTVar memory
        let after = v >= high || (before && v > low)
        when (after /= before) (writeTVar memory after)
        pure after
      -- What a look finds out is remembered if the operator acts on it, in the same
      -- transaction, and is undone if the operator goes on waiting. Then this
      -- remembers it.
      remembering value = forever . atomically $ do
        before <- readTVar memory
        after <- state value
        check (after /= before)
  pure
    source
      { workers = workers source ++ [Worker "hysteresis" (const . remembering . quietly <$> view source)]
      , view = looking state <$> view source
      }

-- | A look for those who wait for values only: what it throws is for the operator,
-- which looks for itself.
quietly :: View a -> STM a
quietly v = look v First `catchSTM` \(_ :: SomeException) -> retry

-- | Opens the sources of a signal once, for all its occurrences in a behaviour.
--
-- > withShared s body  ~  body s     but with one thread a sensor, not one an occurrence
--
-- The sensors are read for as long as the behaviour runs. All that the behaviour
-- throws is thrown. Outside it the shared signal is closed: to open it there is a
-- fault, an 'ErrorCall'.
--
-- >>> import Data.IORef
-- >>> count <- newIORef (0 :: Int)
-- >>> let sensor = Signal.polling 0.001 (atomicModifyIORef' count (\n -> (n + 1, n)))
-- >>> Signal.withShared sensor $ \s -> Signal.rSelect ((==) <$> s <*> s) (pure "one sensor") (pure "two sensors")
-- "one sensor"
--
-- @since 0.1.0.0
withShared :: Signal a -> (Signal a -> Behavior b) -> Behavior b
withShared signal body = do
  closed <- newTVarIO False
  -- It closes only when all have ended: of those who are still being stopped, some
  -- may just be looking.
  structured (sharing closed) `finally` atomically (writeTVar closed True)
 where
  sharing closed scope = do
    source <- open signal
    others <- newEmptyTMVarIO
    let shared = Signal $ do
          atomically stillOpen
          running <- atomically (readTMVar others)
          let attended value = stillOpen >> for_ running unlessLost >> value
          pure source {workers = [], view = looking attended <$> view source}
        stillOpen = readTVar closed >>= \isClosed -> when isClosed (throwSTM closedError)
        unlessLost sensor = (lost sensor >>= throwSTM) `orElse` pure ()
    -- The body comes first, so that its fault is the leftmost.
    main <- branch scope (Label "withShared" "body") (body shared)
    (_, running) <- startWorkers scope "withShared" source
    atomically (putTMVar others running)
    settle <$> atomically (outcome main)
  closedError = ErrorCall "withShared: the shared signal was used outside its behaviour"

-- | Starts what must run while the source is looked at, and gives a view of it. The
-- view comes first, and so do those of the workers: else they might just miss the
-- first reading, and wait for a second one.
startWorkers :: Scope -> String -> Source a -> IO (View a, [Branch ()])
startWorkers scope operator source = do
  (works, seen) <- atomically ((,) <$> traverse work (workers source) <*> view source)
  running <- for (zip (workers source) works) $ \(w, run) ->
    worker scope (Label operator (workerName w)) run
  pure (seen, running)

-- | Waits until a worker has died, and says of what. (One that was asked to stop has
-- not.)
lost :: Branch () -> STM SomeException
lost sensor =
  outcome sensor >>= \case
    Failing e -> pure e
    Faulted e -> pure e
    _ -> retry
