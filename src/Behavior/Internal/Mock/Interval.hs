{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Intervals: the subjects of claims that have a start and an end. And what moments and intervals have in common:
-- lines and instants of a record.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.Interval
  ( Interval (..)
  , running
  , being
  , heldFor
  , Range (..)
  , isInside

    -- * Lines
  , Line
  , numbered
  , time
  , isAbout
  , isEnd
  , needOf

    -- * Instants
  , Instant (..)
  , Side (..)
  , at
  , tolerance
  , checked

    -- * Premises
  , Premise (..)
  , Origin (..)
  , ofInterval
  ) where

import Data.List (find)
import Data.Maybe (mapMaybe)

import Behavior.Internal.Mock.Record
import Behavior.Internal.Mock.Subject
import Behavior.Internal.Seam.Runtime (Seconds)

-- $setup
-- >>> import Data.List (sortOn)
-- >>> import Behavior.Sim.Mock
-- >>> import Behavior.Internal.Mock.Record
-- >>> let line s name = RecordEntry s name "" 1
-- >>> let low = [line 0 "low" (Is "False"), line 4 "low" (Becomes "True")]
-- >>> let drive = [line 0 "drive" Begins, line 4 "drive" StopRequested, line 5 "drive" Stops]
-- >>> let charge = [line 5 "charge" Begins, line 9 "charge" Succeeds]
-- >>> let entries = sortOn entryTime (low ++ drive ++ charge)
-- >>> let record = Record [("low", ACondition), ("drive", AnAction), ("charge", AnAction)] entries 9
-- >>> let check claim = either putStr pure (verdict claim record)

-- | Something that has a start and an end: an action that runs, or a condition that has
-- a certain value.
--
-- @since 0.1.0.0
data Interval = Interval
  { intervalWords :: String
  , intervalNeeds :: [Need]
  , intervalRanges :: Record -> [Range]
  -- ^ Each time that it is going on, in order. None starts after the end of the record.
  }

-- | One time that an interval is going on.
data Range = Range
  { from :: Instant
  , to :: Instant
  , start :: Line
  -- ^ The line that shows its start, at the time of the start.
  }

-- | An instant in a record: a time; whether it is before all that happens at that time, at an entry, or after
-- all; and the number of that entry.
data Instant = Instant Seconds Side Int
  deriving (Eq, Ord)

-- | In order.
data Side = Before | At | After
  deriving (Eq, Ord)

-- | The instant of a line.
at :: Line -> Instant
at (n, entry) = Instant (entryTime entry) At n

-- | Whether an instant is between the start and the end.
isInside :: Instant -> Range -> Bool
isInside instant range = from range < instant && instant < to range

-- | The action runs: from its beginning to its end, cleanup included.
--
-- @since 0.1.0.0
running :: String -> Interval
running name =
  Interval (show name ++ " is running") [Need name "is running" anyAction Nothing] $
    rangesFrom (\e -> e `isAbout` name && entryKind e == Begins) $ \begun e ->
      fullName e == fullName begun && entryCall e == entryCall begun && isEnd (entryKind e)

-- | The condition, or the value that the sensor reads, is this.
--
-- @since 0.1.0.0
being :: Show a => String -> a -> Interval
being name value =
  Interval (show name ++ " is " ++ shown) [needOf name "is " shown] $
    rangesFrom (\e -> e `isAbout` name && entryKind e `elem` [Is shown, Becomes shown]) $ \_ e ->
      e `isAbout` name && changes (entryKind e)
 where
  shown = show value
  changes (Becomes _) = True
  changes kind = kind == LosesValue

rangesFrom :: (RecordEntry -> Bool) -> (RecordEntry -> RecordEntry -> Bool) -> Record -> [Range]
rangesFrom begins ends record =
  [ Range (at row) (maybe openEnd at (find (ends entry . snd) (drop (n + 1) rows))) row
  | row@(n, entry) <- rows
  , begins entry
  ]
 where
  rows = numbered record
  openEnd = Instant (1 / 0) After 0

-- | The same interval, but it begins only when it has been going on for the given number of seconds: so what
-- happens at the moment of its start, or shortly after it, does not count. A negative number or NaN is rejected
-- with an 'Control.Exception.ErrorCall'.
--
-- >>> holds (never (running "drive" `overlapping` being "low" True)) record
-- False
-- >>> holds (never (running "drive" `overlapping` (being "low" True `heldFor` 1))) record
-- True
-- >>> check (never (running "drive" `overlapping` (being "low" True `heldFor` 0.1)))
-- This does not hold: never "drive" is running while "low" is True for over 0.1 s.
-- It was so at 4.1 s:
--     ...
--     0.0 s  drive: begins
--     4.0 s  low: becomes True
--   > 4.0 s  drive: stop requested
--     5.0 s  drive: has stopped
--     5.0 s  charge: begins
--     ...
--
-- @since 0.1.0.0
heldFor :: Interval -> Seconds -> Interval
heldFor s seconds =
  checked "heldFor" seconds `seq` s
    { intervalWords = intervalWords s ++ " for over " ++ inSeconds seconds
    , intervalRanges = \record -> mapMaybe (later record) (intervalRanges s record)
    }
 where
  later record range
    | begun < to range && begun < Instant (recordEnd record) Before 0 =
        Just range {from = begun, start = (shown, entry {entryTime = due})}
    | otherwise = Nothing
   where
    (n, entry) = start range
    due = entryTime entry + seconds
    -- After all that happens at that time. Those that are due at the same time keep their order.
    begun = Instant (due + tolerance) After (order (from range))
    shown = last (n : map fst (takeWhile (\row -> at row < begun) (drop n (numbered record))))
  order (Instant _ _ n) = n

infixl 9 `heldFor`

-- | An entry of a record, with its number from 0. (Where something is shown that has no entry of its
-- own, the last entry before it, with another time.)
type Line = (Int, RecordEntry)

-- | The time that a line shows.
time :: Line -> Seconds
time = entryTime . snd

-- | The lines of a record.
numbered :: Record -> [Line]
numbered = zip [0 ..] . recordEntries

-- | Whether the entry is about the subject of this name, with any argument or this one.
isAbout :: RecordEntry -> String -> Bool
isAbout entry name = name `elem` [entrySubject entry, fullName entry]

-- | Whether an entry of this kind is the end of an action.
isEnd :: EntryKind -> Bool
isEnd kind = case kind of
  Succeeds -> True
  Fails _ -> True
  Faults _ -> True
  Stops -> True
  _ -> False

-- | That something has this value.
needOf :: String -> String -> String -> Need
needOf name verb shown = Need name (verb ++ shown) [ASensor, ACondition] (Just shown)

-- | What has to come, or a claim holds whatever happens.
data Premise = Premise
  { premiseWords :: String
  , comes :: Record -> Origin -> Bool
  -- ^ Whether it comes after the origin.
  }

-- | The entry after which a claim is checked, and its time. (For the whole record the
-- entry is -1.)
data Origin = Origin Int Seconds

-- | The interval is going on.
ofInterval :: Interval -> Premise
ofInterval s = Premise (intervalWords s) $ \record (Origin origin since) ->
  any ((> Instant since At origin) . to) (intervalRanges s record)

-- | Times that differ by less are the same: for example a sum and the time of a timer.
tolerance :: Seconds
tolerance = 0.000001

-- | Rejects a number that is not zero or more.
checked :: String -> Seconds -> ()
checked name seconds
  | seconds >= 0 = ()
  | otherwise = errorWithoutStackTrace (name ++ ": zero or more seconds, not " ++ show seconds)
