{-# OPTIONS_HADDOCK not-home #-}

-- |
-- A signal whose sources are opened once, for several operators.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Signal.Shared
  ( withShared
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (ErrorCall (..), finally)
import Control.Monad (when)

import Behavior.Internal.Concurrent.Scope
import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Seam.Runtime
import Behavior.Internal.Signal.Source

-- $setup
-- >>> import Behavior
-- >>> import qualified Behavior.Signal as Signal

-- | Opens the sources of a signal once, for all its occurrences in a behaviour.
--
-- > withShared s body  ~  body s     but with one thread per sensor, not one per occurrence
--
-- The sensors are read for as long as the behaviour runs. Their stop is requested together
-- with the behaviour's: a cleanup must not wait for them. An operator inside decides on a
-- reading that began after the operator did, and so waits for the next slot, up to a period.
-- Everything that the behaviour throws is thrown. Outside the behaviour the shared signal is
-- closed: opening it there is a fault, an 'ErrorCall'.
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
  -- (A consumer that reads the times of readings may come later.)
  source <- open signal everyValue {readingTimes = True}
  closed <- newTVarIO False
  -- It is closed only when everything has ended: a thread that is still stopping may be reading
  -- it.
  structured "withShared" (sharing source closed) `finally` atomically (writeTVar closed True)
 where
  sharing source closed scope = do
    sensors <- newEmptyTMVarIO
    let shared = Signal $ \_ -> do
          running <- atomically (stillOpen >> readTMVar sensors)
          let orSensorError value = stillOpen >> sensorError running >>= maybe value throwSTM
          pure source {workers = [], view = mapView orSensorError <$> view source}
        stillOpen = readTVar closed >>= \isClosed -> when isClosed (throwSTM closedError)
    -- The body comes first, so that its fault is the leftmost.
    main <- branch scope "body" (body shared)
    (_, running) <- startSensors scope source
    atomically (putTMVar sensors running)
    endedBy "body" <$> atomically (outcome main)
  closedError = ErrorCall "withShared: the shared signal was used outside its behaviour"
