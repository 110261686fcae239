{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Moments: the subjects of claims that take no time; also moments inside or outside of an interval.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.Moment
  ( Moment (..)
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
  , premiseOf
  , shortlyAfter
  ) where

import Data.List (intercalate)

import Behavior.Internal.Mock.Interval
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

-- | A kind of record entry, of which there may be none, one or many:
-- @startOf "recharge"@.
--
-- @since 0.1.0.0
data Moment = Moment
  { momentWords :: String
  , momentNeeds :: [Need]
  , momentPremises :: [Premise]
  -- ^ What has to come, or there can be no such entry.
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
-- start. The record has values as they are shown: so a value of another type never comes. (If the record has
-- the same value as another type shows it, @5.0@ for @5@, that is an error.)
--
-- @since 0.1.0.0
becoming :: Show a => String -> a -> Moment
becoming name value =
  (momentOf [] ("becomes " ++ shown) (`elem` [Is shown, Becomes shown]) name)
    { momentNeeds = [needOf name "becomes " shown]
    }
 where
  shown = show value

-- | This text was recorded by 'Behavior.Sim.Mock.note', or by a 'Behavior.Sim.Mock.driver'. Any text is allowed:
-- one that nothing notes never comes. (If the record has the same text with other quotes, that is an error.)
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
        [ Range (Instant (t - tolerance) Before n) (Instant (t + seconds + tolerance) After (-1)) row
        | row@(n, entry) <- occurrences m record
        , let t = entryTime entry
        ]
    }

-- | The moment comes.
premiseOf :: Moment -> Premise
premiseOf m = Premise (momentWords m) $ \record (Origin origin _) -> any ((> origin) . fst) (occurrences m record)
