{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The record of a mock world.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.Record
  ( Record (..)
  , RecordEntry (..)
  , EntryKind (..)
  , inOrder
  , fullName
  , timeline
  , inSeconds
  , unfitIn
  ) where

import Data.List (sortOn)
import Data.Maybe (mapMaybe)

import Behavior.Internal.Mock.Subject (Need, SubjectKind, unfit)
import Behavior.Internal.Seam.Runtime (Seconds)

-- | The record of a mock world: what has happened in it, in order. It is shown as a
-- timeline, with one line for each entry.
--
-- @since 0.1.0.0
data Record = Record
  { recordSubjects :: [(String, SubjectKind)]
  -- ^ Everything in the world by its name, including what has no entry.
  , recordEntries :: [RecordEntry]
  , recordEnd :: Seconds
  -- ^ The time at which the record ends: in a simulation the end of the run, or the current time while the run
  -- goes on; on real threads the time of the last entry.
  }
  deriving (Eq)

instance Show Record where
  show = unlines . timeline . recordEntries

-- | One entry of a record.
--
-- @since 0.1.0.0
data RecordEntry = RecordEntry
  { entryTime :: Seconds
  -- ^ In seconds since the clock of the world was started.
  , entrySubject :: String
  -- ^ The name of the action, condition or sensor; or the text of the note.
  , entryArgument :: String
  -- ^ The argument, shown, of an action that has one; otherwise empty.
  , entryCall :: Int
  -- ^ The number of the call of the action (with this argument), from 1.
  , entryKind :: EntryKind
  }
  deriving (Eq)

-- | Without the time, since a step of a schedule shows it already.
instance Show RecordEntry where
  show entry = fullName entry ++ kindText (entryKind entry) ++ again
   where
    kindText kind = case kind of
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
      | entryCall entry > 1 = " (call " ++ show (entryCall entry) ++ ")"
      | otherwise = ""

-- | What a record entry says.
--
-- @since 0.1.0.0
data EntryKind
  = -- | An action begins.
    Begins
  | -- | An action returns its result.
    Succeeds
  | -- | An action, its cleanup, or a reading of a sensor fails, with this reason.
    Fails String
  | -- | An action, its cleanup, or a reading of a sensor faults, with this reason.
    Faults String
  | -- | An action receives a stop request.
    StopRequested
  | -- | An action whose stop was requested has stopped, cleanup included.
    Stops
  | -- | A condition has this value, shown, from the start.
    Is String
  | -- | A condition, or the value that a sensor reads, becomes this, shown.
    Becomes String
  | -- | A condition has no value any more.
    LosesValue
  | -- | A note, added by 'Behavior.Sim.Mock.note'.
    Noted
  deriving (Eq, Ord, Show)

-- | The entries, given newest first, in the order of their times. A thread first
-- reads the time and then adds its entry, so the entries of several threads may be added
-- in a different order than that of their times. Entries with equal times stay in the
-- order in which they were added.
inOrder :: [RecordEntry] -> [RecordEntry]
inOrder = sortOn entryTime . reverse

-- | The subject of an entry, with the argument if there is one.
fullName :: RecordEntry -> String
fullName entry
  | null (entryArgument entry) = entrySubject entry
  | otherwise = entrySubject entry ++ " " ++ entryArgument entry

-- | The lines of a timeline.
timeline :: [RecordEntry] -> [String]
timeline entries = [padded (inSeconds (entryTime entry)) ++ "  " ++ show entry | entry <- entries]
 where
  padded time = replicate (width - length time) ' ' ++ time
  width = maximum (0 : map (length . inSeconds . entryTime) entries)

-- | A time rounded to microseconds, which hides the rounding errors of sums.
inSeconds :: Seconds -> String
inSeconds s
  | abs s < 1e9 = show (fromInteger (round (s * 1000000)) / 1000000 :: Seconds) ++ " s"
  | otherwise = show s ++ " s"

-- | If one of the needs does not fit the record: why the first such need does not.
unfitIn :: Record -> [Need] -> Maybe String
unfitIn record = unfit (recordSubjects record) (mapMaybe shown (recordEntries record))
 where
  shown e = case entryKind e of
    Is value -> Just (entrySubject e, value)
    Becomes value -> Just (entrySubject e, value)
    Noted -> Just ("", entrySubject e)
    _ | null (entryArgument e) -> Nothing
    _ -> Just (entrySubject e, entryArgument e)
