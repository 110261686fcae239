{-# LANGUAGE LambdaCase #-}

-- |
-- The switch in the seam: whether an operation is done in reality or in a
-- simulation.
--
-- A simulation takes over the operations of its own threads, and of no others.
-- While none runs, the switch costs one read of a global reference.
module Behavior.Internal.Seam
  ( inSimulation
  , simulator
  , taking
  ) where

import Control.Concurrent (ThreadId, myThreadId)
import Control.Exception (bracket_)
import Data.IORef (IORef, atomicModifyIORef', newIORef, readIORef)
import System.IO.Unsafe (unsafePerformIO)

import Behavior.Internal.Simulator

-- | The simulations that run in this process. They do not know of each other.
simulators :: IORef [(Int, Simulator)]
simulators = unsafePerformIO (newIORef [])
{-# NOINLINE simulators #-}

-- | Does the first in reality, and the second in a simulation.
inSimulation :: IO a -> (Simulator -> IO a) -> IO a
inSimulation really simulated = simulator >>= maybe really simulated
{-# INLINE inSimulation #-}

-- | The simulation that the calling thread is part of.
simulator :: IO (Maybe Simulator)
simulator =
  readIORef simulators >>= \case
    [] -> pure Nothing
    running -> myThreadId >>= whose running
{-# INLINE simulator #-}

-- | The simulation in which this thread has the turn. (Not inlined: what is done while no
-- simulation runs is to be short, and to allocate nothing.)
whose :: [(Int, Simulator)] -> ThreadId -> IO (Maybe Simulator)
whose [] _ = pure Nothing
whose ((_, s) : others) self = hasTurn s self >>= \mine -> if mine then pure (Just s) else whose others self
{-# NOINLINE whose #-}

-- | Lets a simulation (each has a number of its own) take over its threads'
-- operations while the action runs.
taking :: Int -> Simulator -> IO a -> IO a
taking number s = bracket_ (change ((number, s) :)) (change (filter ((/= number) . fst)))
 where
  change f = atomicModifyIORef' simulators (\running -> (f running, ()))
