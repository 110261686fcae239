{-# OPTIONS_HADDOCK not-home #-}

-- |
-- A signal whose sources are opened once, for several operators.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Signal.Shared
  ( withShared
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (ErrorCall (..), finally, throwIO)
import Control.Monad (unless, when)

import Behavior.Internal.Concurrent.Scope
import Behavior.Internal.Core.Backend (Simulator (runNumber))
import Behavior.Internal.Core.Dispatch (simulator)
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
-- closed: opening it there is a fault, an 'ErrorCall', and so is opening it in a simulation that runs inside of the
-- behaviour.
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
  run <- thisRun
  closed <- newTVarIO False
  -- It is closed only when everything has ended: a thread that is still stopping may be reading
  -- it.
  structured "withShared" (sharing source run closed) `finally` atomically (writeTVar closed True)
 where
  sharing source run closed scope = do
    sensors <- newEmptyTMVarIO
    let shared = Signal $ \_ -> do
          here <- thisRun
          unless (here == run) (throwIO elsewhere)
          running <- atomically (stillOpen >> readTMVar sensors)
          let orSensorError value = stillOpen >> sensorError running >>= maybe value throwSTM
          pure source {workers = [], view = mapView orSensorError <$> view source}
        stillOpen = readTVar closed >>= \isClosed -> when isClosed (throwSTM closedError)
    -- The body comes first, so that its fault is the leftmost.
    main <- branch scope "body" (body shared)
    (_, running) <- startSensors scope source
    atomically (putTMVar sensors running)
    endedBy "body" <$> atomically (outcome main)
  -- The number of the simulation that the thread is part of.
  thisRun = fmap runNumber <$> simulator
  elsewhere =
    ErrorCall
      "withShared: the shared signal was opened outside of this simulation, whose behaviours cannot follow it; open it \
      \inside: simulate (withShared ...)"
  closedError = ErrorCall "withShared: the shared signal was used outside its behaviour"
