{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What has happened in a mock world, line by line.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.Record
  ( Record (..)
  , RecordEntry (..)
  , EntryKind (..)
  , recorded
  , fullName
  , timeline
  , inSeconds
  ) where

import Data.List (sortOn)

import Behavior.Internal.Runtime (Seconds)

-- | What has happened in a mock world, in the order in which it happened. It is
-- shown as a timeline, one line an entry.
--
-- @since 0.1.0.0
data Record = Record
  { subjects :: [String]
  -- ^ The names of all that is in the world, whether or not anything became of it.
  , entries :: [RecordEntry]
  -- ^ What has happened, in order.
  }
  deriving (Eq)

instance Show Record where
  show = unlines . timeline . entries

-- | One thing that has happened.
--
-- @since 0.1.0.0
data RecordEntry = RecordEntry
  { entryTime :: Seconds
  -- ^ When: in seconds since the clock of the world was started.
  , subject :: String
  -- ^ The name of the action, condition or sensor; or what was noted.
  , argument :: String
  -- ^ The argument, shown, of an action that has one; else nothing.
  , call :: Int
  -- ^ Which call of the action (with this argument) it belongs to, from 1.
  , entryKind :: EntryKind
  }
  deriving (Eq)

-- | Without the time: a line of a schedule, say, has that already.
instance Show RecordEntry where
  show entry = fullName entry ++ told (entryKind entry) ++ again
   where
    told what = case what of
      Begins -> ": begins"
      Succeeds -> ": done"
      Fails why -> ": fails, " ++ why
      Faults why -> ": faults, " ++ why
      StopRequested -> ": stop requested"
      Stops -> ": has stopped"
      Is value -> ": is " ++ value
      Becomes value -> ": becomes " ++ value
      LosesValue -> ": has no value any more"
      Noted -> ""
    again
      | call entry > 1 = " (call " ++ show (call entry) ++ ")"
      | otherwise = ""

-- | What can happen to the things of a mock world.
--
-- @since 0.1.0.0
data EntryKind
  = -- | An action begins.
    Begins
  | -- | An action returns its result.
    Succeeds
  | -- | An action, or its cleanup, or a reading of a sensor fails: why.
    Fails String
  | -- | An action, or its cleanup, or a reading of a sensor faults: why.
    Faults String
  | -- | An action hears that it is to stop.
    StopRequested
  | -- | An action that was asked to stop has stopped, cleanup included.
    Stops
  | -- | A condition has this value, shown, from the start.
    Is String
  | -- | A condition, or what a sensor reads, becomes this, shown.
    Becomes String
  | -- | A condition has no value any more.
    LosesValue
  | -- | Somebody said so.
    Noted
  deriving (Eq, Ord, Show)

-- | A record of what was noted, the newest first. A thread notes its time and then
-- the entry, so that entries of several threads can be noted in another order than
-- that of their times. Entries of one moment stay in the order of the noting.
recorded :: [String] -> [RecordEntry] -> Record
recorded names = Record names . sortOn entryTime . reverse

-- | The name of whom an entry is about, with the argument if there is one.
fullName :: RecordEntry -> String
fullName entry
  | null (argument entry) = subject entry
  | otherwise = subject entry ++ " " ++ argument entry

-- | The lines of a timeline.
timeline :: [RecordEntry] -> [String]
timeline lines' = [padded (inSeconds (entryTime entry)) ++ "  " ++ show entry | entry <- lines']
 where
  padded time = replicate (width - length time) ' ' ++ time
  width = maximum (0 : map (length . inSeconds . entryTime) lines')

-- | A time to read: sums of seconds are off by less than anybody wants to see.
inSeconds :: Seconds -> String
inSeconds s
  | abs s < 1e9 = show (fromInteger (round (s * 1000000)) / 1000000 :: Seconds) ++ " s"
  | otherwise = show s ++ " s"
