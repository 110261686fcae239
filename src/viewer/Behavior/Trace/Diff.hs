-- |
-- What differs between two recordings: for example two runs of one mission.
module Behavior.Trace.Diff
  ( Difference (..)
  , Divergence (..)
  , Side (..)
  , difference
  , renderDifference
  ) where

import qualified Data.IntMap.Strict as IntMap
import Data.List (minimumBy, sortOn)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (listToMaybe)
import Data.Ord (Down (..), comparing)

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Path
import Behavior.Trace.Recording
import Behavior.Trace.Summary (Times (..), timesOfBoth)
import Behavior.Trace.Table

-- | The differences.
--
-- @since 0.1.0.0
data Difference = Difference
  { firstDivergence :: Maybe Divergence
  -- ^ The earliest place at which the two did something else. How long something took is none.
  , timesByPath :: [(Path, Side, Side)]
  -- ^ The paths of which the totals or the numbers of runs differ. The largest difference of the
  -- totals comes first.
  , lostOnEachSide :: (Int, Int)
  -- ^ How many events were lost. If one is not 0, the differences may be of what was lost.
  }
  deriving (Eq, Show)

-- | A place at which two recordings differ.
--
-- @since 0.1.0.0
data Divergence = Divergence
  { divergedAt :: Seconds
  -- ^ When it was, after the beginning of the recording in which it was earlier.
  , divergedPath :: Path
  , divergedRun :: Int
  -- ^ The first run of this name within its parent has number 1.
  , firstDid :: String
  , secondDid :: String
  }
  deriving (Eq, Show)

-- | The runs of one path in one recording.
--
-- @since 0.1.0.0
data Side = Side
  { sideRuns :: Int
  , sideTotal :: Seconds
  }
  deriving (Eq, Show)

-- | What differs between the recordings. The runs of one name in one parent are compared with each
-- other in their order. So the order of branches that run at the same time is no difference.
--
-- @since 0.1.0.0
difference :: Recording -> Recording -> Difference
difference a b =
  Difference
    { firstDivergence = case divergences (pathOf []) 0 (items a) (items b) [] of
        [] -> Nothing
        found -> Just (snd (minimumBy (comparing earliest) found))
    , timesByPath =
        sortOn
          (\(_, x, y) -> Down (abs (sideTotal x - sideTotal y)))
          [ (path, x, y)
          | (path, inFirst, inSecond) <- timesOfBoth a b
          , let (x, y) = (side inFirst, side inSecond)
          , x /= y
          ]
    , lostOnEachSide = (recordingLost a, recordingLost b)
    }
 where
  -- At the same time, how something ended comes before what began then; and of a failure and the
  -- failure of its parent, the inner one comes first.
  earliest ((rank, depth), d) = (divergedAt d, rank, Down depth)
  side = maybe (Side 0 0) (\t -> Side (timesRuns t) (timesTotal t))

-- A span or a reaction.
data Item = Item
  { itemName :: String
  , itemBegan :: Seconds
  , itemEnded :: Seconds
  , itemOutcome :: String
  , itemInner :: [Item]
  }

-- Times are relative to the beginning of the recording.
items :: Recording -> [Item]
items r = below loose (recordingRoots r)
 where
  below these found = sortOn itemBegan (map reacted these ++ map ran found)
  ran n =
    Item
      { itemName = spanName (nodeSpan n)
      , itemBegan = spanBegan (nodeSpan n) - start
      , itemEnded = max (nodeUntil r n) (spanBegan (nodeSpan n)) - start
      , itemOutcome = withoutValues (snd <$> nodeEnd n)
      , itemInner = below (IntMap.findWithDefault [] (spanNumber (nodeSpan n)) inside) (nodeChildren n)
      }
  reacted x =
    Item
      { itemName = "the reaction of " ++ reactionOperator x
      , itemBegan = reactionTime x - start
      , itemEnded = reactionTime x - start
      , itemOutcome = withoutTimes x
      , itemInner = []
      }
  withoutTimes x =
    (if null (reactionChanges x) then nameText (reactionOperator x) ++ " changed" else signals (reactionChanges x))
      ++ maybe "" ((", " ++) . stoppedText (map spanName stopped)) (reactionStopped x)
      ++ maybe "" ((", starts " ++) . startedText (spanName <$> listToMaybe started)) (reactionStarts x)
   where
    (stopped, started) = IntMap.findWithDefault ([], []) (reactionNumber x) involved
  involved = reactionSpans r
  start = recordingFrom r
  (loose, inside) = reactionsInside r

-- Values of signals are left out: those of a sensor are never the same twice.
withoutValues :: Maybe End -> String
withoutValues (Just (StoppedBy (SignalChanged _ changes))) = "stopped: " ++ signals changes
withoutValues end = outcomeText end

signals :: [Change] -> String
signals [] = "a signal changed"
signals changes = nameText (changeSignal (last changes)) ++ " changed"

-- All places, each with its rank and depth, before the rest. Where only one of the recordings has a run, what ran
-- in it is no further divergence.
divergences :: Path -> Int -> [Item] -> [Item] -> [Diverged] -> [Diverged]
divergences outer depth xs ys rest = foldr compared (reordered ++ rest) (Map.toList pairs)
 where
  pairs =
    Map.unionWith
      (\(x, _) (_, y) -> (x, y))
      (Map.map (\x -> (Just x, Nothing)) left)
      (Map.map (\y -> (Nothing, Just y)) right)
  left = numbered xs
  right = numbered ys
  compared (key, found) after = case found of
    (Just x, Just y) ->
      [ diverged 0 key (min (itemEnded x) (itemEnded y)) (itemOutcome x) (itemOutcome y)
      | itemOutcome x /= itemOutcome y
      ]
        ++ divergences (inPath (fst key) outer) (depth + 1) (itemInner x) (itemInner y) after
    (Just x, Nothing) -> diverged 1 key (itemBegan x) (itemOutcome x) "did not run" : after
    (Nothing, Just y) -> diverged 1 key (itemBegan y) "did not run" (itemOutcome y) : after
    (Nothing, Nothing) -> after
  -- One after the other here, and in the opposite order there.
  reordered =
    [ diverged
        1
        k
        (min (itemBegan x) (itemBegan y'))
        ("ran before " ++ quotedText (fst k'))
        ("ran after " ++ quotedText (fst k'))
    | let common = sortOn (itemBegan . fst . snd) (Map.toList (Map.intersectionWith (,) left right))
    , ((k, (x, y)), (k', (x', y'))) <- zip common (drop 1 common)
    , itemEnded x <= itemBegan x'
    , itemEnded y' <= itemBegan y
    , (itemBegan y', itemEnded y') /= (itemBegan y, itemEnded y)
    ]
  diverged :: Int -> (String, Int) -> Seconds -> String -> String -> Diverged
  diverged rank (name, n) at leftDid rightDid = ((rank, depth), Divergence at (inPath name outer) n leftDid rightDid)

type Diverged = ((Int, Int), Divergence)

-- Each with its name and its number among those with the same name.
numbered :: [Item] -> Map (String, Int) Item
numbered found =
  Map.fromList
    [ ((name, n), x)
    | (name, same) <- Map.toList (Map.fromListWith (++) [(itemName x, [x]) | x <- reverse found])
    , (n, x) <- zip [1 ..] same
    ]

-- | The differences as text.
--
-- @since 0.1.0.0
renderDifference :: Difference -> String
renderDifference d = unlines (remarks ++ diverging ++ [""] ++ taking)
 where
  remarks =
    [ which ++ ": " ++ lostRemark n
    | (which, n) <- [("First", fst (lostOnEachSide d)), ("Second", snd (lostOnEachSide d))]
    , n /= 0
    ]
  diverging = case firstDivergence d of
    Nothing -> ["First divergence: none"]
    Just x ->
      [ "First divergence: after " ++ secondsText (divergedAt x) ++ ", " ++ renderPath (divergedPath x)
          ++ (if divergedRun x > 1 then ", run " ++ show (divergedRun x) else "")
      , "  first:   " ++ firstDid x
      , "  second:  " ++ secondDid x
      ]
  taking
    | null (timesByPath d) = ["Time by path: no difference"]
    | otherwise =
        "Time by path"
          : columns
            5
            ["difference [s]", "first [s]", "second [s]", "first runs", "second runs", "path"]
            row
            (timesByPath d)
  row (path, x, y) =
    [ signed (sideTotal y - sideTotal x)
    , millisecondsText (sideTotal x)
    , millisecondsText (sideTotal y)
    , show (sideRuns x)
    , show (sideRuns y)
    , renderPath path
    ]
  signed t = (if t > 0 then "+" else "") ++ millisecondsText t
