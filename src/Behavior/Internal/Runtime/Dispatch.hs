{-# LANGUAGE CPP #-}
{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The switch in the seam: whether an operation is done in reality or in a
-- simulation.
--
-- A simulation takes over the operations of its own threads, and of no others.
-- While none runs, the switch costs one look at a number.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Runtime.Dispatch
  ( inSimulation
  , simulator
  , withBackend
  ) where

import Control.Concurrent (myThreadId)
import Control.Exception (bracket_)
import Data.IORef (IORef, atomicModifyIORef', newIORef, readIORef)
import System.IO.Unsafe (unsafePerformIO)

import Behavior.Internal.Runtime.Backend
import Behavior.Internal.Runtime.Counter

-- | The simulations that run in this process. They do not know of each other.
simulators :: IORef [(Int, Simulator)]
simulators = unsafePerformIO (newIORef [])
{-# NOINLINE simulators #-}

-- | Does the first in reality, and the second in a simulation.
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

-- | The simulation in which the calling thread has the turn. (Not inlined: what is done while
-- no simulation runs is to be short, and to allocate nothing.)
currentBackend :: IO (Maybe Simulator)
currentBackend = readIORef simulators >>= whose . map snd
 where
  whose [] = pure Nothing
  whose (s : others) = do
    mine <- isRunning s =<< myThreadId
    if mine then pure (Just s) else whose others
{-# NOINLINE currentBackend #-}

-- | Lets a simulation (each has a number of its own) take over its threads'
-- operations while the action runs.
withBackend :: Int -> Simulator -> IO a -> IO a
withBackend number s =
  bracket_
    (change ((number, s) :) >> add simulations 1)
    (add simulations (-1) >> change (filter ((/= number) . fst)))
 where
  change f = atomicModifyIORef' simulators (\running -> (f running, ()))
