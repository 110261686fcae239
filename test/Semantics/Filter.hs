{-# OPTIONS_GHC -O1 #-}
-- |
-- Stop requests, views, and the states of filters.
module Semantics.Filter
  ( -- * Requests and readers
    Request (..)
  , View (..)
  , Worker (..)

    -- * States of filters
  , Join (..)
  , HysteresisState (..)
  , Debouncer (..)
  , Throttler (..)
  , ChangeTracking (..)
  , Watchdog (..)
  , WatchdogState (..)
  ) where

import Semantics.Program

-- | The stop requests of a thread. An operator makes at most one, but a thread outside of
-- the operators may make two.
data Request
  = -- | The thread may not have been started yet.
    NotStarted
  | NoRequest
  | Requested
  | -- | Neither request was received.
    RequestedTwice
  | -- | Time has passed since the request, which could not be received: it will be received
    -- before any other step of the thread.
    Pending
  | PendingTwice
  | -- | One request is pending, and time has not passed since another.
    PendingAndRequested
  | Received
  deriving (Eq, Ord, Show)

-- | Which values a reader accepts: only those of readings that began after its view was
-- taken.
data View
  = Always
  | -- | Accepts only readings with a higher number.
    After Int View
  | Each [View]
  deriving (Eq, Ord, Show)

-- | A filter's thread, which reads the filtered source.
data Worker = Worker
  { request :: Request
  , view :: View
  }
  deriving (Eq, Ord, Show)

-- | How several values are combined.
data Join
  = AllHold
  | -- | The index of the first that holds, or -1.
    FirstHolding
  deriving (Eq, Ord, Show)

-- | The state of a hysteresis.
data HysteresisState = HysteresisState
  { low, high :: Int
  , isHigh :: Bool
  , hysteresisWorker :: Worker
  }
  deriving (Eq, Ord, Show)

data Debouncer = Debouncer
  { delay :: Ticks
  , settled :: Maybe Int
  -- ^ The debounced value.
  , pending :: Maybe (Int, Ticks)
  -- ^ The value that is not settled yet, and since when it has lasted.
  , changeWorker :: Worker
  , changeTracking :: ChangeTracking
  , timer :: Request
  , timedChange :: Maybe (Int, Ticks)
  -- ^ The pending change for which the timer was started.
  }
  deriving (Eq, Ord, Show)

-- | Tracking a change takes two steps: the value is read, and then it is stored.
data ChangeTracking
  = Tracked (Maybe Int)
  | Observed (Maybe Int) Int
  deriving (Eq, Ord, Show)

data Throttler = Throttler
  { gap :: Ticks
  , passed :: Maybe Int
  -- ^ The value of the throttled signal.
  , throttleWorker :: Worker
  , restsUntil :: Maybe Ticks
  -- ^ Until when it takes no other value.
  }
  deriving (Eq, Ord, Show)

data Watchdog = Watchdog
  { limit :: Ticks
  , overdue :: Int
  -- ^ Odd while a reading is overdue. It only increases.
  , watchdogRequest :: Request
  , watchdogState :: WatchdogState
  }
  deriving (Eq, Ord, Show)

-- | The watchdog's state: since when the oldest reading has been in flight.
data WatchdogState
  = NoReading
  | InFlight Ticks
  | Overdue Ticks
  deriving (Eq, Ord, Show)
