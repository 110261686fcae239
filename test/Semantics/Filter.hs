-- |
-- Those who look at signals, and what the ones that filter them remember.
module Semantics.Filter
  ( -- * Who looks
    Request (..)
  , View (..)
  , Worker (..)

    -- * What is made of what they see
  , Join (..)
  , Memory (..)
  , Debouncer (..)
  , Noticing (..)
  , Watchdog (..)
  , Guarding (..)
  ) where

import Semantics.Program

-- | An operator asks a thread to stop once at most, but others may ask it again.
data Request
  = -- | Perhaps it has not even been started.
    Unborn
  | Unasked
  | Asked
  | -- | It has heard neither.
    AskedTwice
  | -- | Time has passed since, and it could not hear: it will as soon as it can, before it
    -- does anything else.
    Pending
  | PendingTwice
  | -- | One is due, and another has come.
    PendingAndAsked
  | Heard
  deriving (Eq, Ord, Show)

-- | Which of the values count for someone: those that came after he asked.
data View
  = Always
  | -- | Of the readings, those after so many.
    After Int View
  | Each [View]
  deriving (Eq, Ord, Show)

-- | A thread that looks at a source from its start on.
data Worker = Worker
  { request :: Request
  , view :: View
  }
  deriving (Eq, Ord, Show)

-- | How several values are one.
data Join
  = AllHold
  | -- | The place of the first that holds, or -1.
    FirstHolding
  deriving (Eq, Ord, Show)

-- | Of a hysteresis.
data Memory = Memory
  { low, high :: Int
  , isHigh :: Bool
  , reminder :: Worker
  }
  deriving (Eq, Ord, Show)

data Debouncer = Debouncer
  { delay :: Ticks
  , settled :: Maybe Int
  -- ^ What counts.
  , pending :: Maybe (Int, Ticks)
  -- ^ What does not count yet, and since when it is there.
  , noticer :: Worker
  , noticing :: Noticing
  , timer :: Request
  , timing :: Maybe (Int, Ticks)
  -- ^ What was pending when the timer was set.
  }
  deriving (Eq, Ord, Show)

-- | To notice a value takes two steps: it is seen, and it is written down.
data Noticing
  = Noted (Maybe Int)
  | Noticed (Maybe Int) Int
  deriving (Eq, Ord, Show)

data Watchdog = Watchdog
  { limit :: Ticks
  , overdue :: Int
  -- ^ Odd while a reading is, and higher whenever one has been.
  , guard :: Request
  , guarding :: Guarding
  }
  deriving (Eq, Ord, Show)

-- | What the watchdog knows of the oldest reading: since when it is under way.
data Guarding
  = Free
  | Due Ticks
  | Late Ticks
  deriving (Eq, Ord, Show)
