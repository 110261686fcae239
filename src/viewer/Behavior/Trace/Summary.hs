-- |
-- Where the time went, what interrupted, and what failed.
module Behavior.Trace.Summary
  ( Summary (..)
  , Times (..)
  , Interruptions (..)
  , summary
  , timesOfBoth
  , renderSummary
  ) where

import qualified Data.IntMap.Strict as IntMap
import Data.List (foldl', intercalate, sort, sortOn)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Ord (Down (..))

import Behavior.Time (Seconds)
import Behavior.Trace hiding (named)
import Behavior.Trace.Describe
import Behavior.Trace.Path
import Behavior.Trace.Recording
import Behavior.Trace.Table

-- $setup
-- >>> import Behavior.Trace
-- >>> import Behavior.Trace.Recording

-- | What a recording says about all runs of the same things.
--
-- @since 0.1.0.0
data Summary = Summary
  { times :: [(Path, Times)]
  -- ^ Of the spans with a name. The largest total comes first.
  , interruptions :: [(String, Interruptions)]
  -- ^ By the signal: the last one of a reaction's changes, which the operator watches. An empty name
  -- is that of a signal without a name. The most frequent one comes first.
  , failures :: [(Path, String, Int)]
  -- ^ Where, with what (see 'outcome'), and how many times. The most frequent one comes first.
  , lostEvents :: Int
  -- ^ How many events were lost. If it is not 0, all of this is incomplete.
  }
  deriving (Eq, Show)

-- | The runs of one path. A run that has not ended counts until the end of the recording.
--
-- @since 0.1.0.0
data Times = Times
  { runs :: Int
  , total :: Seconds
  , median :: Seconds
  -- ^ With an even number of runs: the shorter one of the two in the middle.
  , longest :: Seconds
  , outcomes :: [(String, Int)]
  -- ^ How many of the runs had this outcome ('outcomeName'). The most frequent one comes first.
  }
  deriving (Eq, Show)

-- | What one signal interrupted.
--
-- @since 0.1.0.0
data Interruptions = Interruptions
  { interrupted :: Int
  -- ^ How many branches it stopped.
  , stopping :: Seconds
  -- ^ How long that took in total, as far as it is known.
  }
  deriving (Eq, Show)

-- | The summary of a recording.
--
-- >>> let survey n t = Ended (Span n Top Named "survey" 0 Nothing) t Succeeded
-- >>> times (summary (recording [survey 1 2, survey 2 3, survey 3 7]))
-- [(path ["survey"],Times {runs = 3, total = 12.0, median = 3.0, longest = 7.0, outcomes = [("succeeded",3)]})]
--
-- @since 0.1.0.0
summary :: Recording -> Summary
summary r =
  Summary
    { times = sortOn (Down . total . snd) [(where', timesOf found) | (where', found) <- byPath]
    , interruptions = sortOn (\(signal, i) -> (Down (interrupted i), signal)) (Map.toList (bySignal r))
    , failures =
        sortOn
          (\(_, _, n) -> Down n)
          [ (where', what, n)
          | (where', found) <- byPath
          , (what, n) <- counted [outcome end | (_, end@(Just how)) <- found, isFailure how]
          ]
    , lostEvents = lost r
    }
 where
  byPath = flatten (path []) (gather r (roots r)) []
  isFailure (FailedWith _) = True
  isFailure (FaultedWith _) = True
  isFailure _ = False

-- A run: how long it took, and how it ended.
type Run = (Seconds, Maybe End)

-- The runs of each name, and what ran in them.
newtype Level = Level (Map String ([Run], Level))

-- | The times of each path in both recordings; nothing where it did not run.
--
-- @since 0.1.0.0
timesOfBoth :: Recording -> Recording -> [(Path, Maybe Times, Maybe Times)]
timesOfBoth r s = both (path []) (gather r (roots r)) (gather s (roots s)) []
 where
  both outer (Level xs) (Level ys) rest = foldr one rest (Map.keys (xs <> ys))
   where
    one name after = (here, timesOf . fst <$> x, timesOf . fst <$> y) : both here (inside x) (inside y) after
     where
      here = inPath name outer
      (x, y) = (Map.lookup name xs, Map.lookup name ys)
  inside = maybe (Level Map.empty) snd

gather :: Recording -> [Node] -> Level
gather r = level
 where
  level found =
    Level (Map.map merge (Map.fromListWith (++) [(spanName (nodeSpan n), [n]) | n <- reverse (foldr named [] found)]))
  merge same = (map run same, level (concatMap nodeChildren same))
  run n = (max 0 (nodeUntil r n - spanBegan (nodeSpan n)), snd <$> nodeEnd n)
  -- Operators and branches are no part of a path.
  named n rest = if spanKind (nodeSpan n) == Named then n : rest else foldr named rest (nodeChildren n)

-- Before the rest.
flatten :: Path -> Level -> [(Path, [Run])] -> [(Path, [Run])]
flatten outer (Level names) rest = Map.foldrWithKey one rest names
 where
  one name (found, inner) after = let here = inPath name outer in (here, found) : flatten here inner after

timesOf :: [Run] -> Times
timesOf found =
  Times
    { runs = length found
    , total = sum durations
    , median = durations !! ((length durations - 1) `div` 2)
    , longest = last durations
    , outcomes = counted (map (outcomeName . snd) found)
    }
 where
  durations = sort (map fst found)

-- A reaction may have been lost; then the spans that it stopped say that there was one.
bySignal :: Recording -> Map String Interruptions
bySignal r =
  Map.fromListWith plus [(signal changes, Interruptions 1 took) | (changes, took) <- IntMap.elems (reacted <> inferred)]
 where
  plus (Interruptions n t) (Interruptions m u) = Interruptions (n + m) (t + u)
  signal changes = if null changes then "" else changeSignal (last changes)
  reacted =
    IntMap.fromList
      [(reactionNumber x, (reactionChanges x, stoppingTook s)) | x <- reactions r, Just s <- [reactionStopped x]]
  inferred =
    IntMap.fromList [(n, (changes, 0)) | Just (_, StoppedBy (SignalChanged n changes)) <- map nodeEnd (nodes r)]

counted :: [String] -> [(String, Int)]
counted =
  sortOn (\(what, n) -> (Down n, what))
    . Map.toList
    . foldl' (\known what -> Map.insertWith (+) what 1 known) Map.empty

-- | The summary as text: three tables, and a remark if events were lost.
--
-- @since 0.1.0.0
renderSummary :: Summary -> String
renderSummary s =
  unlines . intercalate [""] . filter (not . null) $
    [ [lostRemark (lostEvents s) | lostEvents s /= 0]
    , table "Time by path" ["runs", "total [s]", "median [s]", "longest [s]", "outcomes", "path"] 4 timesRow (times s)
    , table "Interruptions by signal" ["count", "stopping took [s]", "signal"] 2 interruptionRow (interruptions s)
    , table "Failures by path" ["count", "path"] 1 failureRow (failures s)
    ]
 where
  table title headings numbers row rows
    | null rows = [title ++ ": none"]
    | otherwise = title : columns numbers headings row rows
  timesRow (where', t) =
    [ show (runs t)
    , milliseconds (total t)
    , milliseconds (median t)
    , milliseconds (longest t)
    , intercalate ", " [what ++ " " ++ percent n (runs t) | (what, n) <- outcomes t]
    , renderPath where'
    ]
  percent n m = show (round (100 * fromIntegral n / fromIntegral m :: Double) :: Int) ++ " %"
  interruptionRow (signal, i) =
    [ show (interrupted i)
    , milliseconds (stopping i)
    , if null signal then "a signal without a name" else nameText signal
    ]
  failureRow (where', what, n) = [show n, renderPath where' ++ ": " ++ what]
