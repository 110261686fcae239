{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The parts of a record that claims are about: moments and intervals.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.Moment
  ( Lines
  , numbered

    -- * Moments
  , Moment (..)
  , startOf
  , endOf
  , successOf
  , failureOf
  , faultOf
  , interruptionOf
  , becoming
  , noted
  , anyOf
  , during
  , outside
  , overlapping
  , countOf

    -- * Intervals
  , Interval (..)
  , running
  , being
  , heldFor
  , shortlyAfter
  , Range (..)
  , at
  ) where

import Data.List (intercalate)
import Data.Maybe (fromMaybe, listToMaybe, mapMaybe)

import Behavior.Internal.Mock.Record
import Behavior.Internal.Runtime (Seconds)

-- $setup
-- >>> import Behavior.Sim.Mock
-- >>> import Behavior.Internal.Mock.Record
-- >>> let line s name = RecordEntry s name "" 1
-- >>> let drive = [line 0 "drive" Begins, line 4 "low" (Becomes "True"), line 4 "drive" StopRequested, line 5 "drive" Stops]
-- >>> let charge = [line 5 "charge" Begins, line 9 "charge" Succeeds]
-- >>> let record = Record ["low", "drive", "charge"] (line 0 "low" (Is "False") : drive ++ charge)
-- >>> let check claim = either putStr pure (verdict claim record)

-- | The entries of a record, numbered from 0.
type Lines = [(Int, RecordEntry)]

-- | A kind of record entry, of which there may be none, one or many:
-- @startOf "recharge"@.
--
-- @since 0.1.0.0
data Moment = Moment
  { momentWords :: String
  , momentNames :: [String]
  , occurrences :: Lines -> Lines
  }

-- | The action begins. For an action with an argument the name alone means any argument,
-- and @"open \\"front\\""@ means this one.
--
-- @since 0.1.0.0
startOf :: String -> Moment
startOf = momentOf "begins" (== Begins)

-- | The action ends, in any way, cleanup included.
--
-- @since 0.1.0.0
endOf :: String -> Moment
endOf = momentOf "ends" isEnd

-- | The action returns its result.
--
-- @since 0.1.0.0
successOf :: String -> Moment
successOf = momentOf "is done" (== Succeeds)

-- | The action (or its cleanup) fails, or the sensor does.
--
-- @since 0.1.0.0
failureOf :: String -> Moment
failureOf = momentOf "fails" isFailing
 where
  isFailing (Fails _) = True
  isFailing _ = False

-- | The action (or its cleanup) faults, or the sensor does.
--
-- @since 0.1.0.0
faultOf :: String -> Moment
faultOf = momentOf "faults" isFaulting

isFaulting :: EntryKind -> Bool
isFaulting (Faults _) = True
isFaulting _ = False

-- | The action receives a stop request.
--
-- @since 0.1.0.0
interruptionOf :: String -> Moment
interruptionOf = momentOf "is interrupted" (== StopRequested)

-- | The condition, or the value that the sensor reads, becomes this, or is this from the
-- start.
--
-- @since 0.1.0.0
becoming :: Show a => String -> a -> Moment
becoming name value = momentOf ("becomes " ++ show value) (`elem` [Is (show value), Becomes (show value)]) name

-- | This text was recorded by 'Behavior.Sim.Mock.note'.
--
-- @since 0.1.0.0
noted :: String -> Moment
noted text = (momentOf "is noted" (== Noted) text) {momentNames = []}

momentOf :: String -> (EntryKind -> Bool) -> String -> Moment
momentOf verb isIt name =
  Moment
    { momentWords = show name ++ " " ++ verb
    , momentNames = [name]
    , occurrences = filter $ \(_, entry) -> entry `isAbout` name && isIt (entryKind entry)
    }

isAbout :: RecordEntry -> String -> Bool
isAbout entry name = name `elem` [entrySubject entry, fullName entry]

isEnd :: EntryKind -> Bool
isEnd kind = case kind of
  Succeeds -> True
  Fails _ -> True
  Faults _ -> True
  Stops -> True
  _ -> False

-- | Any of these.
--
-- >>> countOf (anyOf [startOf "drive", startOf "charge"]) record
-- 2
--
-- @since 0.1.0.0
anyOf :: [Moment] -> Moment
anyOf ms =
  Moment
    { momentWords = intercalate " or " (map momentWords ms)
    , momentNames = concatMap momentNames ms
    , occurrences = \rows -> foldr (merged . (`occurrences` rows)) [] ms
    }

-- | The rows of both lists, each once, in order.
merged :: Lines -> Lines -> Lines
merged (x : xs) (y : ys) = case compare (fst x) (fst y) of
  LT -> x : merged xs (y : ys)
  EQ -> x : merged xs ys
  GT -> y : merged (x : xs) ys
merged xs ys = xs ++ ys

-- | Those that happen inside an interval (after its start and before its end).
--
-- >>> check (never (interruptionOf "drive" `during` being "low" True))
-- This does not hold: never "drive" is interrupted while "low" is True.
-- It was so at 4.0 s:
--     ...
--     0.0 s  drive: begins
--     4.0 s  low: becomes True
--   > 4.0 s  drive: stop requested
--     5.0 s  drive: has stopped
--     5.0 s  charge: begins
--     ...
--
-- @since 0.1.0.0
during :: Moment -> Interval -> Moment
during = restricted "while" id

-- | Those that do not happen inside an interval.
--
-- >>> holds (never (startOf "charge" `outside` being "low" True)) record
-- True
--
-- @since 0.1.0.0
outside :: Moment -> Interval -> Moment
outside = restricted "unless" not

restricted :: String -> (Bool -> Bool) -> Moment -> Interval -> Moment
restricted word wanted m s =
  Moment
    { momentWords = momentWords m ++ " " ++ word ++ " " ++ intervalWords s
    , momentNames = momentNames m ++ intervalNames s
    , occurrences = \rows ->
        let inside (n, _) = any (isInside (at n)) (intervalRanges s rows)
         in filter (wanted . inside) (occurrences m rows)
    }

-- | One interval starts while the other is going on. To claim that two actions exclude
-- each other: @never (running "recharge" \`overlapping\` running "drive")@. With the same
-- action twice it means that two of its calls run at the same time.
--
-- >>> holds (never (running "drive" `overlapping` running "charge")) record
-- True
--
-- @since 0.1.0.0
overlapping :: Interval -> Interval -> Moment
overlapping a b =
  Moment (intervalWords a ++ " while " ++ intervalWords b) (intervalNames a ++ intervalNames b) $ \rows ->
    let as = intervalRanges a rows
        bs = intervalRanges b rows
        these `startsIn` others = [start this | this <- these, any (isInside (from this)) others]
     in merged (as `startsIn` bs) (bs `startsIn` as)

infixl 8 `during`, `outside`, `overlapping`

-- | How often it happened.
--
-- >>> countOf (startOf "drive") record
-- 1
--
-- @since 0.1.0.0
countOf :: Moment -> Record -> Int
countOf m = length . occurrences m . numbered

-- | The lines of a record.
numbered :: Record -> Lines
numbered = zip [0 ..] . recordEntries

-- | Something that has a start and an end: an action that runs, or a condition that has
-- a certain value.
--
-- @since 0.1.0.0
data Interval = Interval
  { intervalWords :: String
  , intervalNames :: [String]
  , intervalRanges :: Lines -> [Range]
  -- ^ Each time that it is going on, in order.
  }

-- | One time that an interval is going on.
data Range = Range
  { from :: Place
  , to :: Place
  , start :: (Int, RecordEntry)
  -- ^ The entry that shows its start, at the time of the start.
  }

-- | A place in a record: at the entry with this number, or between it and the next one (if the second
-- number is not 0).
type Place = (Int, Int)

-- | The place of the entry with this number.
at :: Int -> Place
at n = (n, 0)

-- | Whether a place is between the start and the end.
isInside :: Place -> Range -> Bool
isInside place range = from range < place && place < to range

-- | The action runs: from its beginning to its end, cleanup included.
--
-- @since 0.1.0.0
running :: String -> Interval
running name =
  Interval (show name ++ " is running") [name] $
    rangesFrom (\e -> e `isAbout` name && entryKind e == Begins) $ \begun e ->
      fullName e == fullName begun && entryCall e == entryCall begun && isEnd (entryKind e)

-- | The condition, or the value that the sensor reads, is this.
--
-- @since 0.1.0.0
being :: Show a => String -> a -> Interval
being name value =
  Interval (show name ++ " is " ++ show value) [name] $
    rangesFrom (\e -> e `isAbout` name && entryKind e `elem` [Is (show value), Becomes (show value)]) $ \_ e ->
      e `isAbout` name && changes (entryKind e)
 where
  changes (Becomes _) = True
  changes kind = kind == LosesValue

rangesFrom :: (RecordEntry -> Bool) -> (RecordEntry -> RecordEntry -> Bool) -> Lines -> [Range]
rangesFrom begins ends rows =
  [ Range (at n) (at (fromMaybe maxBound (listToMaybe [k | (k, e) <- drop (n + 1) rows, ends entry e]))) row
  | row@(n, entry) <- rows
  , begins entry
  ]

-- | Only after it has been going on for the given number of seconds: so what happens at the moment of its
-- start, or shortly after it, does not count. A negative number or NaN is rejected with an
-- 'Control.Exception.ErrorCall'.
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
    , intervalRanges = \rows -> mapMaybe (later rows) (intervalRanges s rows)
    }
 where
  later rows range
    | begun < to range = Just range {from = begun, start = (shown, entry {entryTime = due})}
    | otherwise = Nothing
   where
    (n, entry) = start range
    due = entryTime entry + seconds
    shown = last (n : map fst (takeWhile (isBy due) (drop n rows)))
    begun = (shown, 1 + n)

infixl 9 `heldFor`

-- | The given number of seconds after each time that it happens, and the moment itself: all that has the
-- same time, whether it is recorded before or after it. A negative number or NaN is rejected with an
-- 'Control.Exception.ErrorCall'.
--
-- >>> holds (never (interruptionOf "drive" `outside` shortlyAfter 0.1 (becoming "low" True))) record
-- True
-- >>> check (never (startOf "charge" `outside` shortlyAfter 0.1 (becoming "low" True)))
-- This does not hold: never "charge" begins unless within 0.1 s after "low" becomes True.
-- It was so at 5.0 s:
--     ...
--     4.0 s  drive: stop requested
--     5.0 s  drive: has stopped
--   > 5.0 s  charge: begins
--     9.0 s  charge: done
--
-- @since 0.1.0.0
shortlyAfter :: Seconds -> Moment -> Interval
shortlyAfter seconds m =
  checked "shortlyAfter" seconds `seq` Interval
    { intervalWords = "within " ++ inSeconds seconds ++ " after " ++ momentWords m
    , intervalNames = momentNames m
    , intervalRanges = \rows -> [range rows row | row <- occurrences m rows]
    }
 where
  range rows row@(_, entry) =
    let before = length (takeWhile (not . isBy' (entryTime entry)) rows)
        through = length (takeWhile (isBy (entryTime entry + seconds)) rows)
     in Range (before - 1, 1) (through - 1, 1) row
  isBy' t (_, entry) = entryTime entry >= t - tolerance

-- | Whether the entry is not later than this (to a microsecond).
isBy :: Seconds -> (Int, RecordEntry) -> Bool
isBy t (_, entry) = entryTime entry <= t + tolerance

tolerance :: Seconds
tolerance = 0.000001

-- | Rejects a number that is not zero or more.
checked :: String -> Seconds -> ()
checked name seconds
  | seconds >= 0 = ()
  | otherwise = errorWithoutStackTrace (name ++ ": zero or more seconds, not " ++ show seconds)
