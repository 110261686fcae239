{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- What a signal is made of.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Signal.Source
  ( -- * Signals
    Signal (..)
  , watching

    -- * Opening
  , Demand (..)
  , everyValue
  , contramapDemand
  , suppressEqual

    -- * Sources
  , Source (..)
  , fromView
  , View (..)
  , ReadMode (..)
  , readView
  , constantView
  , mapView

    -- * What must run for them
  , Worker (..)
  , Sensors
  , startSensors
  , sensorError
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (SomeException)
import Data.Traversable (for)

import Behavior.Internal.Failure (failWith)
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
newtype Signal a = Signal {open :: Demand a -> IO (Source a)}

instance Functor Signal where
  fmap f signal = Signal $ \demand -> fmap f <$> open signal (demand `contramapDemand` f)

instance Applicative Signal where
  pure a = Signal (\_ -> pure (pure a))
  f <*> a = Signal $ \demand ->
    (<*>) <$> open f everyValue {readingTimes = readingTimes demand} <*> open a everyValue {readingTimes = readingTimes demand}

-- | What a consumer needs of a source.
data Demand a = Demand
  { equalFor :: a -> a -> Bool
  -- ^ Which values it need not tell apart: a reading that is the same as the one before may
  -- be suppressed.
  , readingTimes :: Bool
  -- ^ Whether it looks at 'inFlightSince'.
  }

-- | To be given every value, and nothing else.
everyValue :: Demand a
everyValue = Demand {equalFor = \_ _ -> False, readingTimes = False}

-- | The demand that a consumer of the function's results has on its arguments.
contramapDemand :: Demand b -> (a -> b) -> Demand a
contramapDemand demand f = demand {equalFor = \a b -> equalFor demand (f a) (f b)}

-- | The signal with equal consecutive values suppressed, where that saves something.
suppressEqual :: Eq a => Signal a -> Signal a
suppressEqual signal = Signal $ \demand -> open signal demand {equalFor = (==)}

-- | A signal that was opened, for one run of an operator.
data Source a = Source
  { workers :: [Worker]
  -- ^ What must run while the source is looked at.
  , view :: STM (View a)
  -- ^ A view of the values that are read from this moment on.
  , inFlightSince :: STM (Maybe Seconds)
  -- ^ When the oldest reading began that is in flight, if that was demanded.
  }

-- | The source that gives this view, and needs no worker.
fromView :: STM (View a) -> Source a
fromView it = Source {workers = [], view = it, inFlightSince = pure Nothing}

instance Functor Source where
  fmap f source = source {view = fmap f <$> view source}

instance Applicative Source where
  pure = fromView . pure . pure
  f <*> a =
    Source
      { workers = workers f ++ workers a
      , view = (<*>) <$> view f <*> view a
      , inFlightSince = earliest <$> inFlightSince f <*> inFlightSince a
      }
   where
    earliest (Just s) (Just t) = Just (min s t)
    earliest s Nothing = s
    earliest Nothing t = t

-- | How to look at a value. To look throws when there is none any more.
data View a = View
  { firstRead :: !(STM a)
  -- ^ For the first time: waits for a value, however long that takes to come.
  , reread :: !(STM a)
  -- ^ After that: a value that is not there has been lost.
  }

instance Functor View where
  fmap f = mapView (fmap f)

instance Applicative View where
  pure = constantView . pure
  View f f' <*> View a a' = View (f <*> a) (f' <*> a')

-- | Whether the operator has had a value before.
data ReadMode = FirstRead | Reread

-- | The value, looked at in that way.
readView :: ReadMode -> View a -> STM a
readView FirstRead = firstRead
readView Reread = reread

-- | To look the same way each time.
constantView :: STM a -> View a
constantView value = View value value

-- | The view, looked at in another way.
mapView :: (STM a -> STM b) -> View a -> View b
mapView f (View a a') = View (f a) (f a')
{-# INLINE mapView #-}

-- | A thread that a source needs while it is looked at. It runs until its stop is requested,
-- and can see whether it was. It may be started again after a pause.
data Worker = Worker
  { workerName :: String
  , prepare :: STM (IO Bool -> IO ())
  -- ^ Prepares one start, and gives what is then to run.
  }

-- | The value that a transaction gives: event-driven. It reacts to the very
-- transaction that changes the value, and costs nothing while nothing changes.
--
-- While the transaction retries at first, the operator waits for a value (limit that by
-- 'Behavior.Time.timeout', if it may never come). If it retries later the signal has no
-- value any more, and the operator fails. What the transaction throws, the operator throws.
--
-- >>> import Control.Concurrent.STM (newTVarIO, readTVar)
-- >>> battery <- newTVarIO (5 :: Int)
-- >>> Signal.waitUntil ((< 10) <$> Signal.watching (readTVar battery))
--
-- @since 0.1.0.0
watching :: STM a -> Signal a
watching transaction = Signal . const . pure . fromView . pure $ View transaction (transaction `orElse` noValueAnyMore)
 where
  noValueAnyMore = failWith "the signal has no value any more"

-- | The threads that run for a source, from left to right.
type Sensors = [Branch ()]

-- | Starts what must run while the source is looked at, and gives a view of it. The
-- view comes first, and so do those of the workers: otherwise they could just miss the
-- first reading, and wait for a second one.
startSensors :: Scope -> String -> Source a -> IO (View a, Sensors)
startSensors scope operator source = case workers source of
  [] -> (\seen -> (seen, [])) <$> atomically (view source)
  needed -> do
    (runs, seen) <- atomically ((,) <$> traverse prepare needed <*> view source)
    running <- for (zip needed runs) $ \(w, run) -> worker scope (Label operator (workerName w)) run
    (seen, running) <$ yieldReal

-- | What one of them has died of, if it has, the leftmost first. (One whose stop was
-- requested has not.)
sensorError :: Sensors -> STM (Maybe SomeException)
sensorError = foldr orDied (pure Nothing)
 where
  orDied sensor others = tryReadOutcomeSTM sensor >>= maybe others (pure . Just) . (>>= cause)
  cause = \case
    Failing e -> Just e
    Faulted e -> Just e
    _ -> Nothing
