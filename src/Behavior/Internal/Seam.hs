{-# LANGUAGE GeneralizedNewtypeDeriving #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE RankNTypes #-}

-- |
-- The switch in the seam: whether an operation is done in reality or in a
-- simulation.
--
-- A simulation takes over the operations of its own threads, and of no others.
-- While none runs, the switch costs one read of a global reference.
module Behavior.Internal.Seam
  ( -- * What both sides speak of
    Label (..)
  , Seconds (..)
  , Event (..)

    -- * The switch
  , Simulator (..)
  , inSimulation
  , simulator
  , taking
  ) where

import Control.Concurrent (ThreadId, myThreadId)
import Control.Concurrent.STM (STM)
import Control.Exception (SomeException, bracket_)
import Data.IORef (IORef, atomicModifyIORef', newIORef, readIORef)
import Numeric (showFFloat)
import System.IO.Unsafe (unsafePerformIO)

-- | Who started a thread, and what runs in it: @Label "monitor" "task"@.
data Label = Label
  { labelOperator :: String
  , labelBranch :: String
  }
  deriving (Eq, Ord)

instance Show Label where
  show (Label operator "") = operator
  show (Label operator branch) = operator ++ ": " ++ branch

-- | A length of time, or a moment on the clock of 'Behavior.Time.now', in seconds.
-- Write it as a literal: @sleep 0.5@; turn other numbers into it with 'realToFrac'.
--
-- @since 0.1.0.0
newtype Seconds = Seconds Double
  deriving (Eq, Ord, Num, Fractional, Real, RealFrac)

instance Show Seconds where
  -- 0.05, and not 5.0e-2
  showsPrec precedence (Seconds s) = showParen (s < 0 && precedence > 6) (showFFloat Nothing s)

instance Read Seconds where
  readsPrec precedence input = [(Seconds s, rest) | (s, rest) <- readsPrec precedence input]

-- | What can be reported of the life of a behaviour.
data Event
  = Started Label
  | Ended Label
  | -- | What a behaviour says of itself.
    Noted String
  deriving (Eq, Ord, Show)

-- | How a simulation does what its threads ask of the seam.
data Simulator = Simulator
  { hasTurn :: ThreadId -> IO Bool
  -- ^ Whether this is the one thread of the simulation that runs just now.
  , spawn :: forall a. Label -> (IO () -> (forall b. IO b -> IO b) -> IO a) -> (a -> STM ()) -> IO ThreadId
  -- ^ Starts a thread, masked, and publishes what it gives as it ends. The thread is given
  -- an action to begin with, in which an early cancellation arrives, and how to unmask.
  , deliver :: ThreadId -> SomeException -> IO ()
  -- ^ Throws to a thread and waits until it has heard it.
  , send :: ThreadId -> SomeException -> IO ()
  -- ^ Throws to a thread, some time, and does not wait.
  , transact :: forall a. STM a -> IO a
  , clock :: IO Seconds
  , await :: Seconds -> IO ()
  -- ^ Waits until that moment.
  , pause :: IO ()
  -- ^ Lets the others run, and lets a cancellation arrive.
  , record :: Event -> IO ()
  }

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
