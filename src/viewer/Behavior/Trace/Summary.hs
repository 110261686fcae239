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
  { summaryTimes :: [(Path, Times)]
  -- ^ Of the spans with a name. The largest total comes first.
  , summaryInterruptions :: [(String, Interruptions)]
  -- ^ By the signal: the last one of a reaction's changes, which the operator watches. An empty name
  -- is that of a signal without a name. The most frequent one comes first.
  , summaryFailures :: [(Path, String, Int)]
  -- ^ Where, with what (see 'outcomeText'), and how many times. The most frequent one comes first.
  , summaryLost :: Int
  -- ^ How many events were lost. If it is not 0, all of this is incomplete.
  }
  deriving (Eq, Show)

-- | The runs of one path. A run that has not ended counts until the end of the recording.
--
-- @since 0.1.0.0
data Times = Times
  { timesRuns :: Int
  , timesTotal :: Seconds
  , timesMedian :: Seconds
  -- ^ With an even number of runs: the shorter one of the two in the middle.
  , timesLongest :: Seconds
  , timesOutcomes :: [(String, Int)]
  -- ^ How many of the runs had this outcome ('outcomeName'). The most frequent one comes first.
  }
  deriving (Eq, Show)

-- | What one signal interrupted.
--
-- @since 0.1.0.0
data Interruptions = Interruptions
  { interruptionsCount :: Int
  -- ^ How many branches it stopped.
  , interruptionsTook :: Seconds
  -- ^ How long that took in total, as far as it is known.
  }
  deriving (Eq, Show)

-- | The summary of a recording.
--
-- >>> let survey n t = Ended (Span n Top Named "survey" 0 Nothing) t Succeeded
-- >>> let [(path, t)] = summaryTimes (summary (recording [survey 1 2, survey 2 3, survey 3 7]))
-- >>> (path, timesRuns t, timesTotal t, timesMedian t, timesLongest t, timesOutcomes t)
-- (pathOf ["survey"],3,12.0,3.0,7.0,[("succeeded",3)])
--
-- @since 0.1.0.0
summary :: Recording -> Summary
summary r =
  Summary
    { summaryTimes = sortOn (Down . timesTotal . snd) [(path, timesOf found) | (path, found) <- byPath]
    , summaryInterruptions = sortOn (\(signal, i) -> (Down (interruptionsCount i), signal)) (Map.toList (bySignal r))
    , summaryFailures =
        sortOn
          (\(_, _, n) -> Down n)
          [ (path, what, n)
          | (path, found) <- byPath
          , (what, n) <- counted [outcomeText end | (_, end@(Just how)) <- found, isFailure how]
          ]
    , summaryLost = recordingLost r
    }
 where
  byPath = flatten (pathOf []) (gather r (recordingRoots r)) []
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
timesOfBoth r s = both (pathOf []) (gather r (recordingRoots r)) (gather s (recordingRoots s)) []
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
    { timesRuns = length found
    , timesTotal = sum durations
    , timesMedian = durations !! ((length durations - 1) `div` 2)
    , timesLongest = last durations
    , timesOutcomes = counted (map (outcomeName . snd) found)
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
      [ (reactionNumber x, (reactionChanges x, stoppingTook s))
      | x <- recordingReactions r
      , Just s <- [reactionStopped x]
      ]
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
    [ [lostRemark (summaryLost s) | summaryLost s /= 0]
    , table "Time by path" timesHeadings 4 timesRow (summaryTimes s)
    , table
        "Interruptions by signal"
        ["count", "stopping took [s]", "signal"]
        2
        interruptionRow
        (summaryInterruptions s)
    , table "Failures by path" ["count", "path"] 1 failureRow (summaryFailures s)
    ]
 where
  table title headings numbers row rows
    | null rows = [title ++ ": none"]
    | otherwise = title : columns numbers headings row rows
  timesHeadings = ["runs", "total [s]", "median [s]", "longest [s]", "outcomes", "path"]
  timesRow (path, t) =
    [ show (timesRuns t)
    , millisecondsText (timesTotal t)
    , millisecondsText (timesMedian t)
    , millisecondsText (timesLongest t)
    , intercalate ", " [what ++ " " ++ percent n (timesRuns t) | (what, n) <- timesOutcomes t]
    , renderPath path
    ]
  percent n m = show (round (100 * fromIntegral n / fromIntegral m :: Double) :: Int) ++ " %"
  interruptionRow (signal, i) =
    [ show (interruptionsCount i)
    , millisecondsText (interruptionsTook i)
    , if null signal then "a signal without a name" else nameText signal
    ]
  failureRow (path, what, n) = [show n, renderPath path ++ ": " ++ what]
