{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Signals, and the sources that they open.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Signal.Source
  ( -- * Signals
    Signal (..)
  , watching
  , named
  , namedWith
  , unlessNamed
  , orNamed
  , openInTrace
  , dependingOnTrace
  , conditionOfRule

    -- * Opening
  , Demand (..)
  , everyValue
  , contramapDemand
  , suppressEqual

    -- * Sources
  , Source (..)
  , fromView
  , View (..)
  , readings
  , ReadMode (..)
  , readView
  , constantView
  , mapView

    -- * The threads of a source
  , Worker (..)
  , Sensors
  , startSensors
  , sensorError
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (SomeException)
import Data.Maybe (fromMaybe)
import Data.Traversable (for)

import Behavior.Internal.Concurrent.Outcome (Outcome (..))
import Behavior.Internal.Concurrent.Scope
import Behavior.Internal.Core.Failure (failWith)
import Behavior.Internal.Seam.Runtime
import Behavior.Internal.Spans.Observer (Reading (..))
import Behavior.Internal.Spans.Place (isTraced)

-- $setup
-- >>> import Behavior
-- >>> import qualified Behavior.Signal as Signal

-- | A value that changes over time and can be watched.
--
-- (Functional reactive programming calls this a /behaviour/. Here a behaviour is
-- what the robot does.)
--
-- A signal only describes its sources: each occurrence opens them separately. So
-- @(==) \<$\> s \<*\> s@ on a polled signal @s@ reads the sensor in two threads and
-- can be false; 'withShared' opens the sources once for all occurrences. The value of a
-- signal with several sources consists of the latest value of each, which may be from
-- different moments. The signal has a value when each source has one.
--
-- A change that is undone before the next reading has no effect. A value must be equal to itself: with
-- NaN, which is not, a signal changes all the time, and what watches it never rests.
--
-- @since 0.1.0.0
newtype Signal a = Signal {open :: Demand a -> IO (Source a)}

instance Functor Signal where
  fmap f signal = Signal $ \demand -> fmap f <$> open signal (demand `contramapDemand` f)

instance Applicative Signal where
  pure a = Signal (\_ -> pure (pure a))
  f <*> a = Signal $ \demand ->
    (<*>)
      <$> open f everyValue {readingTimes = readingTimes demand}
      <*> open a everyValue {readingTimes = readingTimes demand}

-- | What a consumer needs of a source.
data Demand a = Demand
  { equalFor :: a -> a -> Bool
  -- ^ Which values are equal for it: a reading that is equal to the one before may be
  -- suppressed.
  , readingTimes :: Bool
  -- ^ Whether it reads 'inFlightSince'.
  }

-- | Demands every value, and no times.
everyValue :: Demand a
everyValue = Demand {equalFor = \_ _ -> False, readingTimes = False}

-- | The demand on a function's arguments, given the demand on its results.
contramapDemand :: Demand b -> (a -> b) -> Demand a
contramapDemand demand f = demand {equalFor = \a b -> equalFor demand (f a) (f b)}

-- | The signal with equal consecutive values suppressed, where suppression saves work.
suppressEqual :: Eq a => Signal a -> Signal a
suppressEqual signal = Signal $ \demand -> open signal demand {equalFor = (==)}

-- | An opened signal, for one run of an operator.
data Source a = Source
  { workers :: [Worker]
  -- ^ The threads that must run while the source is read.
  , view :: STM (View a)
  -- ^ A view of the values that are obtained from this moment on.
  , inFlightSince :: STM (Maybe Seconds)
  -- ^ When the oldest reading in flight began, if that was demanded.
  , names :: [String]
  -- ^ The names of the signals that it is made of, from left to right.
  }

-- | The source that gives this view, and needs no worker.
fromView :: STM (View a) -> Source a
fromView it = Source {workers = [], view = it, inFlightSince = pure Nothing, names = []}

instance Functor Source where
  fmap f source = source {view = fmap f <$> view source}

instance Applicative Source where
  pure = fromView . pure . pure
  f <*> a =
    Source
      { workers = workers f ++ workers a
      , view = (<*>) <$> view f <*> view a
      , inFlightSince = earliest <$> inFlightSince f <*> inFlightSince a
      , names = names f ++ names a
      }
   where
    earliest (Just s) (Just t) = Just (min s t)
    earliest s Nothing = s
    earliest Nothing t = t

-- | How to read a value. Reading throws when the value has been lost.
data View a = View
  { firstRead :: !(STM a)
  -- ^ The first read: retries until there is a value, however long that takes.
  , reread :: !(STM a)
  -- ^ A later read: a value that is missing has been lost.
  , namedValues :: !(Maybe (STM [Reading]))
  -- ^ What 'readings' gives; nothing if no signal in it has a name. (So views are combined without an action for
  -- that.)
  }

instance Functor View where
  fmap f = mapView (fmap f)

instance Applicative View where
  pure = constantView . pure
  View f f' these <*> View a a' those = View (f <*> a) (f' <*> a') (both these those)
   where
    both Nothing right = right
    both left Nothing = left
    both (Just left) (Just right) = Just ((++) <$> left <*> right)

-- | The named values that the value is made of, for traces. Read them in a transaction that has
-- read the value.
readings :: View a -> STM [Reading]
readings = fromMaybe (pure []) . namedValues
{-# NOINLINE readings #-}

-- | Whether the operator has had a value before.
data ReadMode = FirstRead | Reread

-- | Reads the value, as a first or a later read.
readView :: ReadMode -> View a -> STM a
readView FirstRead = firstRead
readView Reread = reread

-- | The view whose first and later reads are the same.
constantView :: STM a -> View a
constantView value = View value value Nothing

-- | Applies the function to both ways of reading.
mapView :: (STM a -> STM b) -> View a -> View b
mapView f seen = seen {firstRead = f (firstRead seen), reread = f (reread seen)}
{-# INLINE mapView #-}

-- | A thread that a source needs while it is read. It runs until its stop is requested, and can
-- read whether that has happened. It may be started again after a pause.
data Worker = Worker
  { workerName :: String
  , prepare :: STM (IO Bool -> IO ())
  -- ^ Prepares one start, and gives the action that the thread runs.
  }

-- | The value that a transaction returns. The signal is event-driven: the operator reacts to
-- the transaction that changes the value, and nothing is done while nothing changes.
--
-- If the transaction retries at first, the operator waits for a value (if there may never
-- be one, limit that by 'Behavior.Time.timeout'). If it retries later, the signal no longer has
-- a value, and the operator fails. What the transaction throws, the operator throws.
--
-- The transaction should only read: it is run whenever a variable that it has read changes, and more often
-- in a trace. (To take something from a queue, use "Behavior.Message".)
--
-- >>> import Control.Concurrent.STM (newTVarIO, readTVar)
-- >>> battery <- newTVarIO (5 :: Int)
-- >>> Signal.waitUntil ((< 10) <$> Signal.watching (readTVar battery))
--
-- @since 0.1.0.0
watching :: STM a -> Signal a
watching transaction =
  Signal . const . pure . fromView . pure $
    View transaction (transaction `orElse` noValueAnyMore) Nothing
 where
  noValueAnyMore = failWith "the signal has no value any more"

-- | Gives the signal a name. A trace shows it, with the signal's value before and after a change that
-- has interrupted something ("Behavior.Trace"); 'Behavior.Signal.whileHolding' reports it when it
-- ends a behaviour.
--
-- > named name  =  namedWith name show
--
-- What is made of the signal (by 'fmap', a filter, ...) has that name too, unless it gets its own.
-- A trace shows both: the level of a battery, say, and that it is low.
--
-- >>> let wind = Signal.named "wind" (pure (12 :: Int))
-- >>> Signal.whileHolding ((< 10) <$> wind) (putStrLn "fly")
-- *** Exception: FailedBecause "the condition does not hold: wind"
-- >>> Signal.whileHolding (Signal.named "calm" ((< 10) <$> wind)) (putStrLn "fly")
-- *** Exception: FailedBecause "the condition does not hold: calm"
--
-- @since 0.1.0.0
named :: Show a => String -> Signal a -> Signal a
named name = namedWith name show

-- | 'named', with a function for the text of a value in a trace. It is computed by the trace's sinks,
-- outside of the operator; what it throws is shown as such.
--
-- >>> let position = Signal.namedWith "x" (show . fst) (pure (0.5, 1.5))
-- >>> Signal.waitUntil ((< 1) . fst <$> position)
--
-- @since 0.1.0.0
namedWith :: String -> (a -> String) -> Signal a -> Signal a
namedWith name render signal = Signal $ \demand -> do
  source <- open signal demand
  -- (Also without a trace: it may begin while the source is open, in 'Behavior.Signal.withShared'.)
  pure source {view = showing name render <$> view source, names = [name]}

-- | The condition. If nothing in it has a name, its readings include its value under this name.
unlessNamed :: String -> Signal Bool -> Signal Bool
unlessNamed name = Signal . openInTrace (orNamed name)

-- | The same for a source.
orNamed :: String -> Source Bool -> Source Bool
orNamed name source = if null (names source) then source {view = showing name show <$> view source} else source

-- | The condition of the rule with this number. Its readings contain that number, and whether it holds.
conditionOfRule :: Int -> Signal Bool -> Signal Bool
conditionOfRule n = Signal . openInTrace marked . unlessNamed ("condition " ++ show n)
 where
  marked source = source {view = ofRule <$> view source}
  ofRule seen = seen {namedValues = Just (says <$> reread seen <*> readings seen)}
  says holds = map (\r -> r {readingRule = Just (n, holds)})

-- | Opens the signal; if there is a trace, changes the source. (The operator that opens it is in a trace from its
-- beginning, or not at all.)
openInTrace :: (Source a -> Source a) -> Signal a -> Demand a -> IO (Source a)
openInTrace change signal demand = do
  source <- open signal demand
  traced <- isTraced
  pure $! if traced then change source else source
{-# INLINE openInTrace #-}

-- | The signal that the function gives, depending on whether there is a trace. (Where each part of a signal would
-- be opened by 'openInTrace', that would cost memory for each part, also without a trace.)
dependingOnTrace :: (Bool -> Signal a) -> Signal a
dependingOnTrace choose = Signal $ \demand -> isTraced >>= \traced -> open (choose traced) demand

-- | The view whose readings include its value.
showing :: String -> (a -> String) -> View a -> View a
showing name render seen =
  seen {namedValues = Just (adding <$> readings seen <*> reread seen)}
 where
  adding before a = before ++ [Reading name (render a) Nothing]

-- | The threads that run for a source, from left to right.
type Sensors = [Branch ()]

-- | Starts the workers of a source, and gives a view of it. The view is taken before the workers
-- start, and so are the views that the workers use: otherwise they could miss the first
-- reading, and have to wait for a second one.
startSensors :: Scope -> Source a -> IO (View a, Sensors)
startSensors scope source = case workers source of
  [] -> (\seen -> (seen, [])) <$> atomically (view source)
  needed -> do
    (runs, seen) <- atomically ((,) <$> traverse prepare needed <*> view source)
    running <- for (zip needed runs) $ \(w, run) -> branchWith plainly scope (workerName w) run
    (seen, running) <$ yieldReal

-- | What a sensor has failed or faulted with, if one has (the leftmost first). A sensor that
-- stopped because its stop was requested does not count.
sensorError :: Sensors -> STM (Maybe SomeException)
sensorError = foldr orDied (pure Nothing)
 where
  orDied sensor others = tryReadOutcomeSTM sensor >>= maybe others (pure . Just) . (>>= cause)
  cause = \case
    FailedWith e -> Just e
    FaultedWith e -> Just e
    _ -> Nothing
