{-# LANGUAGE CPP #-}
{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The dispatch of the seam: whether an operation is done in reality or in a simulation.
--
-- A simulation does the operations of its own threads, and of no others.
-- While no simulation runs, the dispatch costs one read of a counter.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Core.Dispatch
  ( inSimulation
  , simulator
  , withBackend
  ) where

import Control.Concurrent (myThreadId)
import Control.Exception (bracket_)
import Data.IORef (IORef, atomicModifyIORef', newIORef, readIORef)
import System.IO.Unsafe (unsafePerformIO)

import Behavior.Internal.Core.Backend
import Behavior.Internal.Core.Counter

-- | The simulations that run in this process. They are independent of each other.
simulators :: IORef [(Int, Simulator)]
simulators = unsafePerformIO (newIORef [])
{-# NOINLINE simulators #-}

-- | Runs the first in reality, and the second in a simulation.
inSimulation :: IO a -> (Simulator -> IO a) -> IO a
#if defined(SEAMLESS)
inSimulation really _ = really
#else
inSimulation really simulated = simulator >>= maybe really simulated
#endif
{-# INLINE inSimulation #-}

-- | The simulation that the calling thread is part of.
simulator :: IO (Maybe Simulator)
simulator = do
  running <- total simulations
  if running == 0 then pure Nothing else currentBackend
{-# INLINE simulator #-}

-- | The simulation whose running thread is the calling thread. (Not inlined: the code that runs
-- while there is no simulation should be short, and allocate nothing.)
currentBackend :: IO (Maybe Simulator)
currentBackend = readIORef simulators >>= search . map snd
 where
  search [] = pure Nothing
  search (s : others) = do
    mine <- isRunning s =<< myThreadId
    if mine then pure (Just s) else search others
{-# NOINLINE currentBackend #-}

-- | While the action runs, the operations of the simulation's threads are dispatched to it. (The
-- number identifies the simulation, which has a trace.)
withBackend :: Int -> Simulator -> IO a -> IO a
withBackend number s =
  bracket_
    (change ((number, s) :) >> add simulations 1 >> add traces 1)
    (add traces (-1) >> add simulations (-1) >> change (filter ((/= number) . fst)))
 where
  change f = atomicModifyIORef' simulators (\running -> (f running, ()))
