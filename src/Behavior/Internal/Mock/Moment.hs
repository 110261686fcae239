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
  ) where

import Data.List (intercalate)
import Data.Maybe (fromMaybe, listToMaybe)

import Behavior.Internal.Mock.Record

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
        let inside (n, _) = any (\(from, to) -> from < n && n < to) (intervalRanges s rows)
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
  (anyOf [starts a `during` b, starts b `during` a]) {momentWords = intervalWords a ++ " while " ++ intervalWords b}
 where
  starts s = Moment (intervalWords s) (intervalNames s) $ \rows ->
    let from = map fst (intervalRanges s rows) in filter ((`elem` from) . fst) rows

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
  , intervalRanges :: Lines -> [(Int, Int)]
  -- ^ The numbers of the entry that starts it and of the one that ends it ('maxBound' if
  -- there is none), for each time that it is going on.
  }

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

rangesFrom :: (RecordEntry -> Bool) -> (RecordEntry -> RecordEntry -> Bool) -> Lines -> [(Int, Int)]
rangesFrom begins ends rows =
  [ (from, fromMaybe maxBound (listToMaybe [to | (to, e) <- drop (from + 1) rows, ends entry e]))
  | (from, entry) <- rows
  , begins entry
  ]
