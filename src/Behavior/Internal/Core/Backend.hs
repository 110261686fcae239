{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE RankNTypes #-}

-- |
-- The types of the seam, and the operations that a simulation backend implements.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Core.Backend
  ( Label (..)
  , Simulator (..)
  ) where

import Control.Concurrent (ThreadId)
import Control.Concurrent.STM (STM)
import Control.Exception (SomeException)

import Behavior.Internal.Core.Property (Property)
import Behavior.Internal.Core.Seconds (Seconds)

-- | The operator that started a thread, and what runs in it: @Label "monitor" "task"@.
data Label = Label
  { labelOperator :: String
  , labelBranch :: String
  }
  deriving (Eq, Ord)

instance Show Label where
  show (Label operator "") = operator
  show (Label operator branch) = operator ++ ": " ++ branch

-- | The simulation backend: how a simulation does the operations of its threads.
data Simulator = Simulator
  { runNumber :: Int
  -- ^ Which simulation it is.
  , propertyOf :: Maybe Property
  -- ^ The property that runs it, if one does.
  , isRunning :: ThreadId -> IO Bool
  -- ^ Whether this is the one thread of the simulation that runs at the moment.
  , spawn :: forall a. Label -> (IO () -> (forall b. IO b -> IO b) -> IO a) -> (a -> STM ()) -> IO ThreadId
  -- ^ Starts a thread, masked, and publishes its result when it ends. The thread is given an
  -- action to run first, in which an early cancellation is received, and a function to unmask.
  , deliver :: ThreadId -> SomeException -> IO ()
  -- ^ Throws to a thread, and waits until the thread has received it.
  , send :: ThreadId -> SomeException -> IO ()
  -- ^ Throws to a thread at some later step, and does not wait.
  , transact :: forall a. STM a -> IO a
  , clock :: IO Seconds
  , await :: Seconds -> IO ()
  -- ^ Waits until that moment.
  , pause :: IO ()
  -- ^ Lets other threads run, and lets a pending cancellation be received.
  , recording :: IO Bool
  -- ^ Whether the run goes on, so that what happens belongs to its record.
  , lookAtClock :: IO Seconds
  -- ^ The current time, or the time when the run ended. Not an operation of the simulation: any
  -- thread may read it at any time.
  , recordStart :: IO ()
  -- ^ Adds to the record that the calling thread starts.
  , recordNote :: String -> IO ()
  -- ^ Adds a text to the record.
  , recordMistake :: SomeException -> IO ()
  -- ^ Keeps what makes the run void, if it is the first: the run ends with it, also if the behaviour returns.
  , recordStartable :: String -> [String] -> IO ()
  -- ^ Adds what an operator with this name, which begins here, can start. (@""@: the scripted actions of a
  -- world.)
  , recordStarted :: Label -> IO ()
  -- ^ Notes that this branch, or scripted action, has been started.
  }
