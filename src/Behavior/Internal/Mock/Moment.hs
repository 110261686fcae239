{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The parts of a record that claims are about: moments and intervals.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.Moment
  ( Line
  , numbered
  , unfitIn
  , time

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

    -- * Premises
  , Premise (..)
  , Origin (..)
  , premiseOf

    -- * Places
  , Place (..)
  , Side (..)
  , at
  , tolerance
  ) where

import Data.List (find, intercalate)
import Data.Maybe (mapMaybe)

import Behavior.Internal.Mock.Record
import Behavior.Internal.Mock.Subject
import Behavior.Internal.Runtime (Seconds)

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

-- | An entry of a record, with its number from 0. (Where something is shown that has no entry of its
-- own, the last entry before it, with another time.)
type Line = (Int, RecordEntry)

-- | The time that a line shows.
time :: Line -> Seconds
time = entryTime . snd

-- | A kind of record entry, of which there may be none, one or many:
-- @startOf "recharge"@.
--
-- @since 0.1.0.0
data Moment = Moment
  { momentWords :: String
  , momentNeeds :: [Need]
  , momentPremises :: [Premise]
  -- ^ What has to come, or there can be none.
  , occurrences :: Record -> [Line]
  -- ^ In order.
  }

-- | The action begins. For an action with an argument the name alone means any argument,
-- and @"open \\"front\\""@ means this one: an argument is written as it is shown.
--
-- @since 0.1.0.0
startOf :: String -> Moment
startOf = momentOf anyAction "begins" (== Begins)

-- | The action ends, in any way, cleanup included.
--
-- @since 0.1.0.0
endOf :: String -> Moment
endOf = momentOf anyAction "ends" isEnd

-- | The action returns its result.
--
-- @since 0.1.0.0
successOf :: String -> Moment
successOf = momentOf anyAction "is done" (== Succeeds)

-- | The action (or its cleanup) fails, or the sensor does.
--
-- @since 0.1.0.0
failureOf :: String -> Moment
failureOf = momentOf (anyAction ++ [ASensor]) "fails" isFailing
 where
  isFailing (Fails _) = True
  isFailing _ = False

-- | The action (or its cleanup) faults, or the sensor does.
--
-- @since 0.1.0.0
faultOf :: String -> Moment
faultOf = momentOf (anyAction ++ [ASensor]) "faults" isFaulting

isFaulting :: EntryKind -> Bool
isFaulting (Faults _) = True
isFaulting _ = False

-- | The action receives a stop request.
--
-- @since 0.1.0.0
interruptionOf :: String -> Moment
interruptionOf = momentOf anyAction "is interrupted" (== StopRequested)

-- | The condition, or the value that the sensor reads, becomes this, or is this from the
-- start. The record has values as they are shown: so a value of another type is one that never comes. (If the
-- record has it in the other type, as @5.0@ and not @5@, that is an error.)
--
-- @since 0.1.0.0
becoming :: Show a => String -> a -> Moment
becoming name value =
  (momentOf [] ("becomes " ++ shown) (`elem` [Is shown, Becomes shown]) name)
    { momentNeeds = [needOf name "becomes " shown]
    }
 where
  shown = show value

-- | That something has this value.
needOf :: String -> String -> String -> Need
needOf name verb shown = Need name (verb ++ shown) [ASensor, ACondition] (Just shown)

-- | This text was recorded by 'Behavior.Sim.Mock.note', or by a 'Behavior.Sim.Mock.driver'. It may be any
-- text: one that nothing notes never comes. (If the record has it with other quotes, that is an error.)
--
-- @since 0.1.0.0
noted :: String -> Moment
noted text = (momentOf [] "is noted" (== Noted) text) {momentNeeds = [Noting text]}

momentOf :: [SubjectKind] -> String -> (EntryKind -> Bool) -> String -> Moment
momentOf kinds verb isIt name =
  Moment
    { momentWords = show name ++ " " ++ verb
    , momentNeeds = [Need name verb kinds Nothing]
    , momentPremises = []
    , occurrences = filter (\(_, entry) -> entry `isAbout` name && isIt (entryKind entry)) . numbered
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

-- | Any of these. Of no moments it is an 'Control.Exception.ErrorCall': none of them could ever come.
--
-- >>> countOf (anyOf [startOf "drive", startOf "charge"]) record
-- 2
--
-- @since 0.1.0.0
anyOf :: [Moment] -> Moment
anyOf [] = errorWithoutStackTrace "anyOf: at least one moment"
anyOf ms =
  Moment
    { momentWords = intercalate " or " (map momentWords ms)
    , momentNeeds = concatMap momentNeeds ms
    , momentPremises = concatMap momentPremises ms
    , occurrences = \record -> foldr (merged . (`occurrences` record)) [] ms
    }

-- | The lines of both lists, each once, in order.
merged :: [Line] -> [Line] -> [Line]
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
during m s = (restricted "while" id m s) {momentPremises = ofInterval s : momentPremises m}

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
    , momentNeeds = momentNeeds m ++ intervalNeeds s
    , momentPremises = momentPremises m
    , occurrences = \record ->
        let ranges = intervalRanges s record
         in filter (\row -> wanted (any (isInside (at row)) ranges)) (occurrences m record)
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
  Moment
    { momentWords = intervalWords a ++ " while " ++ intervalWords b
    , momentNeeds = intervalNeeds a ++ intervalNeeds b
    , momentPremises = [ofInterval a, ofInterval b]
    , occurrences = \record ->
        let as = intervalRanges a record
            bs = intervalRanges b record
         in merged (as `startsIn` bs) (bs `startsIn` as)
    }
 where
  these `startsIn` others = [start this | this <- these, any (isInside (from this)) others]

infixl 8 `during`, `outside`, `overlapping`

-- | How often it happened. A name that does not fit the world is rejected with an
-- 'Control.Exception.ErrorCall' (a claim with such a name does not hold).
--
-- >>> countOf (startOf "drive") record
-- 1
-- >>> countOf (startOf "low") record
-- *** Exception: "low" is a condition, and never begins. The actions of this world: "drive", "charge".
--
-- @since 0.1.0.0
countOf :: Moment -> Record -> Int
countOf m record = case unfitIn record (momentNeeds m) of
  Just why -> errorWithoutStackTrace why
  Nothing -> length (occurrences m record)

-- | Why the first of the needs that does not fit the record does not, if there is one.
unfitIn :: Record -> [Need] -> Maybe String
unfitIn record = unfit (recordSubjects record) (mapMaybe shown (recordEntries record))
 where
  shown e = case entryKind e of
    Is value -> Just (entrySubject e, value)
    Becomes value -> Just (entrySubject e, value)
    Noted -> Just ("", entrySubject e)
    _ | null (entryArgument e) -> Nothing
    _ -> Just (entrySubject e, entryArgument e)

-- | The lines of a record.
numbered :: Record -> [Line]
numbered = zip [0 ..] . recordEntries

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
  { from :: Place
  , to :: Place
  , start :: Line
  -- ^ The line that shows its start, at the time of the start.
  }

-- | A place in a record: the time; whether it is before or after all that happens at that time, or at
-- the entry with the given number.
data Place = Place Seconds Side Int
  deriving (Eq, Ord)

-- | In order.
data Side = Before | At | After
  deriving (Eq, Ord)

-- | The place of a line.
at :: Line -> Place
at (n, entry) = Place (entryTime entry) At n

-- | Whether a place is between the start and the end.
isInside :: Place -> Range -> Bool
isInside place range = from range < place && place < to range

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
  openEnd = Place (1 / 0) After 0

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
    , intervalRanges = \record -> mapMaybe (later record) (intervalRanges s record)
    }
 where
  later record range
    | begun < to range && begun < Place (recordEnd record) Before 0 =
        Just range {from = begun, start = (shown, entry {entryTime = due})}
    | otherwise = Nothing
   where
    (n, entry) = start range
    due = entryTime entry + seconds
    -- After all that happens at that time. Those that are due at the same time keep their order.
    begun = Place (due + tolerance) After (order (from range))
    shown = last (n : map fst (takeWhile (\row -> at row < begun) (drop n (numbered record))))
  order (Place _ _ n) = n

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
    , intervalNeeds = momentNeeds m
    , intervalRanges = \record ->
        [ Range (Place (t - tolerance) Before n) (Place (t + seconds + tolerance) After (-1)) row
        | row@(n, entry) <- occurrences m record
        , let t = entryTime entry
        ]
    }

-- | What has to come, or a claim holds whatever happens.
data Premise = Premise
  { premiseWords :: String
  , comes :: Record -> Origin -> Bool
  -- ^ Whether it comes after the origin.
  }

-- | The entry after which a claim is checked, and its time. (For the whole record the
-- entry is -1.)
data Origin = Origin Int Seconds

-- | The moment comes.
premiseOf :: Moment -> Premise
premiseOf m = Premise (momentWords m) $ \record (Origin origin _) -> any ((> origin) . fst) (occurrences m record)

-- | The interval is going on.
ofInterval :: Interval -> Premise
ofInterval s = Premise (intervalWords s) $ \record (Origin origin since) ->
  any ((> Place since At origin) . to) (intervalRanges s record)

-- | Times that differ by less are the same: for example a sum and the time of a timer.
tolerance :: Seconds
tolerance = 0.000001

-- | Rejects a number that is not zero or more.
checked :: String -> Seconds -> ()
checked name seconds
  | seconds >= 0 = ()
  | otherwise = errorWithoutStackTrace (name ++ ": zero or more seconds, not " ++ show seconds)
