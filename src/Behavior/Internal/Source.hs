{-# LANGUAGE LambdaCase #-}

-- |
-- What a signal is made of.
module Behavior.Internal.Source
  ( -- * Signals
    Signal (..)
  , watching
  , distinct
  , withShared

    -- * Sources
  , Source (..)
  , viewing
  , View (..)
  , always
  , looking

    -- * What must run for them
  , Worker (..)
  , ceaseless
  , startWorkers
  , Sensors
  , startSensors
  , goOn
  , sensorBranches
  , lost
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (ErrorCall (..), SomeException, finally)
import Control.Monad (when)
import Data.Function (on)
import Data.Traversable (for)

import Behavior.Internal.Failure (Behavior, failWith)
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
  , reading :: IO (STM (Maybe Seconds))
  -- ^ Asks to be told when the oldest reading began that is under way; before any worker
  -- is started.
  , alike :: (a -> a -> Bool) -> IO ()
  -- ^ Says which values are alike to all who look, before any worker is started: then nobody
  -- need hear of a reading that is like the last one.
  }

-- | The source that gives this view, and all by itself.
viewing :: STM (View a) -> Source a
viewing it = Source {workers = [], view = it, reading = pure (pure Nothing), alike = \_ -> pure ()}

instance Functor Source where
  fmap f source = source {view = fmap f <$> view source, alike = \same -> alike source (same `on` f)}

instance Applicative Source where
  pure = viewing . pure . pure
  f <*> a =
    (viewing ((<*>) <$> view f <*> view a))
      { workers = map (uncurry Worker . ceaseless) (workers f ++ workers a)
      , reading = (\s t -> earliest <$> s <*> t) <$> reading f <*> reading a
      }
   where
    earliest (Just s) (Just t) = Just (min s t)
    earliest s Nothing = s
    earliest Nothing t = t

-- | How to look at a value. Who looks throws when there is none any more.
data View a = View
  { atFirst :: !(STM a)
  -- ^ For the first time: waits for a value, however long that takes to come.
  , later :: !(STM a)
  -- ^ After that: a value that is not there has been lost.
  }

instance Functor View where
  fmap f = looking (fmap f)

instance Applicative View where
  pure = always . pure
  View f f' <*> View a a' = View (f <*> a) (f' <*> a')

-- | To look the same way each time.
always :: STM a -> View a
always value = View value value

-- | The view, looked at in another way.
looking :: (STM a -> STM b) -> View a -> View b
looking f (View a a') = View (f a) (f a')
{-# INLINE looking #-}

-- | A thread that a source needs while it is looked at. It runs until it is asked to stop,
-- and can see whether it was. It may be started again after a pause; the transaction
-- prepares each start.
data Worker
  = -- | Its name, and what it does.
    Worker String (STM (IO Bool -> IO ()))
  | -- | One that makes a first reading, upon which the source has a value, and returns how
    -- to go on from there.
    Reader String (STM (IO Bool -> IO (IO Bool -> IO ())))

-- | The worker's name, and all that it does.
ceaseless :: Worker -> (String, STM (IO Bool -> IO ()))
ceaseless = \case
  Worker name run -> (name, run)
  Reader name once -> (name, (\run asked -> run asked >>= ($ asked)) <$> once)

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
watching transaction = Signal . pure . viewing . pure $ View transaction (transaction `orElse` noneAnyMore)
 where
  noneAnyMore = failWith "the signal has no value any more"

-- | The signal, for who does not mind if he is not told the same value twice.
distinct :: Eq a => Signal a -> Signal a
distinct signal = Signal $ do
  source <- open signal
  source <$ alike source (==)

-- | Opens the sources of a signal once, for all its occurrences in a behaviour.
--
-- > withShared s body  ~  body s     but with one thread a sensor, not one an occurrence
--
-- The sensors are read for as long as the behaviour runs, and are asked to stop
-- together with it: a cleanup must not wait for them. All that the behaviour throws is
-- thrown. Outside it the shared signal is closed: to open it there is a
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
    underWay <- reading source -- Somebody may ask later.
    others <- newEmptyTMVarIO
    let shared = Signal $ do
          atomically stillOpen
          running <- atomically (readTMVar others)
          let attended value = stillOpen >> anyLost running >>= maybe value throwSTM
          pure (viewing (looking attended <$> view source)) {reading = pure underWay}
        stillOpen = readTVar closed >>= \isClosed -> when isClosed (throwSTM closedError)
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
startWorkers scope operator source = case map ceaseless (workers source) of
  [] -> (\seen -> (seen, [])) <$> atomically (view source)
  needed -> do
    (works, seen) <- atomically ((,) <$> traverse sequenceA needed <*> view source)
    running <- for works $ \(name, run) -> worker scope (Label operator name) run
    (seen, running) <$ giveWay

-- | What reads for an operator.
data Sensors
  = Reading [Branch ()]
  | -- | A thread that ends with its first reading. Who needs no other saves the stop of a
    -- thread that sleeps, which is dearer than its start.
    ReadingOnce Label (Branch (IO Bool -> IO ()))

-- | 'startWorkers', but a single sensor makes one reading, until it has to 'goOn'.
startSensors :: Scope -> String -> Source a -> IO (View a, Sensors)
startSensors scope operator source = case workers source of
  [] -> (\seen -> (seen, Reading [])) <$> atomically (view source)
  [Reader name once] -> do
    (run, seen) <- atomically ((,) <$> once <*> view source)
    let label = Label operator name
    reader <- worker scope label run
    (seen, ReadingOnce label reader) <$ giveWay
  _ -> fmap Reading <$> startWorkers scope operator source

-- | Has them read until they are stopped. Call it when a first reading has been told.
goOn :: Scope -> Sensors -> IO Sensors
goOn scope = \case
  ReadingOnce label reader ->
    ended reader >>= \case
      Completed run -> do
        running <- successor scope reader label run
        pure (Reading [running])
      _ -> pure (ReadingOnce label reader)
  running -> pure running

-- | The threads that read.
sensorBranches :: Sensors -> [SomeBranch]
sensorBranches = \case
  Reading running -> map SomeBranch running
  ReadingOnce _ reader -> [SomeBranch reader]

-- | What one of them has died of, if it has, the leftmost first. (One that was asked to stop
-- has not.)
lost :: Sensors -> STM (Maybe SomeException)
lost = \case
  Reading running -> anyLost running
  ReadingOnce _ reader -> anyLost [reader]

anyLost :: [Branch a] -> STM (Maybe SomeException)
anyLost = foldr orLost (pure Nothing)
 where
  orLost sensor others = outcomeSoFar sensor >>= maybe others (pure . Just) . (>>= cause)
  cause = \case
    Failing e -> Just e
    Faulted e -> Just e
    _ -> Nothing
