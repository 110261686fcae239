{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE RankNTypes #-}

-- |
-- What the two sides of the seam speak of, and what a simulation does for its threads.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Runtime.Backend
  ( Label (..)
  , Event (..)
  , Simulator (..)
  ) where

import Control.Concurrent (ThreadId)
import Control.Concurrent.Async (Async)
import Control.Concurrent.STM (STM)
import Control.Exception (SomeException)

import Behavior.Internal.Seconds (Seconds)

-- | Who started a thread, and what runs in it: @Label "monitor" "task"@.
data Label = Label
  { labelOperator :: String
  , labelBranch :: String
  }
  deriving (Eq, Ord)

instance Show Label where
  show (Label operator "") = operator
  show (Label operator branch) = operator ++ ": " ++ branch

-- | What can be reported of the life of a behaviour.
data Event
  = Started Label
  | Ended Label
  | -- | What a behaviour says of itself.
    Annotated String
  deriving (Eq, Ord, Show)

-- | How a simulation does what its threads ask of the seam.
data Simulator = Simulator
  { isRunning :: ThreadId -> IO Bool
  -- ^ Whether this is the one thread of the simulation that runs just now.
  , spawn :: forall a. Label -> (IO () -> (forall b. IO b -> IO b) -> IO a) -> (a -> STM ()) -> IO (Async ())
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
  , recording :: IO Bool
  -- ^ Whether the run goes on, and what happens belongs to its record.
  , lookAtClock :: IO Seconds
  -- ^ What time it is, or was when the run ended; no operation, for any thread at any time.
  , record :: Event -> IO ()
  }
