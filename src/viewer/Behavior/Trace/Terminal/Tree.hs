{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What is known at a moment, as the lines of a tree.
module Behavior.Trace.Terminal.Tree
  ( treeLines
  ) where

import Data.Bifunctor (first)
import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import Data.List (intercalate, sortOn)
import Numeric (showFFloat)

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Terminal.Live
import Behavior.Trace.Terminal.Screen

-- | What is shown at that time, on at most that number of lines and of columns: the spans that
-- run, since when; the last that ended in each; the last interruption with its cause; the last
-- failures.
--
-- @since 0.1.0.0
treeLines :: Int -> Int -> Seconds -> Live -> [Line]
treeLines rows width time live =
  map (cutLine width) (take rows (fitting (rows - length below) tree ++ below))
 where
  tree = activeLines width time live
  below = take (rows `div` 2) extras
  extras = interruptionLines width time live ++ map (failedLine time) (liveFailed live) ++ lostLine live

-- A line, and how important it is: 0 is the most important.
type Ranked = (Int, Line)

-- The most important ones in their order, and how many are left out.
fitting :: Int -> [Ranked] -> [Line]
fitting rows ranked
  | missing <= 0 = map snd ranked
  | rows <= 0 = []
  | otherwise =
      [line | (k, (_, line)) <- numbered, IntMap.member k chosen]
        ++ [[(Muted, "… " ++ show (missing + 1) ++ " more")]]
 where
  missing = length ranked - rows
  numbered = zip [0 ..] ranked
  chosen = IntMap.fromList (map (fmap fst) (take (rows - 1) (sortOn importance numbered)))
  -- Of what ended, the latest.
  importance (k, (rank, _)) = (rank, if rank < 2 then k else negate k :: Int)

activeLines :: Int -> Seconds -> Live -> [Ranked]
activeLines width time live = doneLines width 0 (liveDone live) (liveDoneCount live) ++ foldr (node 0) [] tops
 where
  (tops, children) = byParent (liveActive live)
  node :: Int -> Active -> [Ranked] -> [Ranked]
  node depth a rest =
    (rank, indent width depth ++ [(Good, "● "), (Strong, room width depth (nameText (spanName s))), (Normal, since)])
      : doneLines width (depth + 1) (activeDone a) (activeDoneCount a)
      ++ foldr (node (depth + 1)) rest (IntMap.findWithDefault [] (spanNumber s) children)
   where
    s = activeSpan a
    since = " " ++ clock (time - spanBegan s)
    rank = if depth < 3 then 0 else 1

-- Those in no other that runs; and those in each.
byParent :: IntMap Active -> ([Active], IntMap [Active])
byParent active =
  ( filter ((== Nothing) . parentOf) (IntMap.elems active)
  , IntMap.fromListWith (++) [(p, [a]) | a <- reverse (IntMap.elems active), Just p <- [parentOf a]]
  )
 where
  parentOf a = case spanParent (activeSpan a) of
    Inside p | p < spanNumber (activeSpan a), IntMap.member p active -> Just p
    _ -> Nothing

-- The last ones that ended, the latest last, and how many ended before them.
doneLines :: Int -> Int -> [Done] -> Int -> [Ranked]
doneLines width depth done count =
  [(9, indent width depth ++ [(Muted, "· " ++ show earlier ++ " ended before")]) | earlier > 0]
    ++ concatMap one (reverse done)
 where
  earlier = count - length done
  one d =
    (rank d, indent width depth ++ mark (doneEnd d) ++ [(Normal, room width depth (nameText (doneName d))), how d])
      : doneLines width (depth + 1) (doneInside d) (doneCount d)
  rank d = case doneEnd d of
    FailedWith _ -> 3
    FaultedWith _ -> 3
    StoppedBy _ -> 4
    Succeeded -> 5 + min 3 depth
  how d = case doneEnd d of
    Succeeded -> (Muted, " " ++ secondsText (doneTook d))
    end -> (paint end, " " ++ endText (doneTook d) end)
  mark end = [(paint end, symbol end)]
  symbol end = case end of
    Succeeded -> "· "
    StoppedBy _ -> "■ "
    _ -> "✗ "
  paint end = case end of
    Succeeded -> Muted
    StoppedBy _ -> Interrupted
    _ -> Bad

interruptionLines :: Int -> Seconds -> Live -> [Line]
interruptionLines width time live = case liveInterruption live of
  Nothing -> []
  Just i ->
    [ [(Interrupted, "◆ " ++ intercalate " -> " changed), (Muted, ", " ++ ago time (reactionTime (interruptedBy i)))]
    , [(Normal, "  " ++ intercalate " -> " done)]
    ]
   where
    (changed, done) =
      reactionParts (map (first short) (reverse (interruptedSpans i))) (short <$> startedSpan i) (interruptedBy i)
 where
  short = cutTo (max 8 (width `div` 3))

failedLine :: Seconds -> FailedSpan -> Line
failedLine time f = case map snd (failedPath f) of
  name : outer ->
    [ (Bad, "✗ " ++ nameText name ++ ": " ++ howText (failedHow f))
    , (Muted, place outer ++ ", " ++ ago time (failedAt f))
    ]
  [] -> []
 where
  place [] = ""
  place outer = " in " ++ intercalate " > " (map nameText (reverse (take 4 outer)))

lostLine :: Live -> [Line]
lostLine live = [[(Bad, "(" ++ lostText (liveLost live) ++ ")")] | liveLost live > 0]

indent :: Int -> Int -> Line
indent width depth = [(Normal, replicate (min (2 * depth) (width `div` 3)) ' ')]

-- The name, so that how long it runs is seen too.
room :: Int -> Int -> String -> String
room width depth = cutTo (max 6 (width - min (2 * depth) (width `div` 3) - 14))

ago :: Seconds -> Seconds -> String
ago time t = clock (time - t) ++ " ago"

-- How long, in a form that does not change its width with each redraw.
clock :: Seconds -> String
clock t
  | isNaN s || isInfinite s || s < 0 = "0.0 s"
  | s < 59.95 = showFFloat (Just 1) s " s"
  | minutes < 60 = show minutes ++ " min " ++ two (whole `mod` 60) ++ " s"
  | otherwise = show (minutes `div` 60) ++ " h " ++ two (minutes `mod` 60) ++ " min"
 where
  s = realToFrac t :: Double
  whole = round s :: Integer
  minutes = whole `div` 60
  two n = if n < 10 then '0' : show n else show n
