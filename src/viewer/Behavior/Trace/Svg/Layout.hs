-- |
-- Where the spans of a timeline are: in which lane, from where to where, and which of them are
-- drawn as one mark.
module Behavior.Trace.Svg.Layout
  ( -- * Lanes
    Placed (..)
  , place
  , maxLanes

    -- * Marks
  , Mark (..)
  , marks
  , isMerged
  ) where

import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import Data.List (foldl', nub, sortOn)
import qualified Data.Map.Strict as Map

import Behavior.Trace
import Behavior.Trace.Recording (Node (..))
import Behavior.Trace.Svg.Outcome

-- | A span with its lane and the pixels between which it is drawn.
data Placed = Placed
  { placedNode :: !Node
  , placedLane :: !Int
  , placedLeft :: !Double
  , placedRight :: !Double
  , placedBelow :: !Bool
  -- ^ It is in the last lane with others, because there are not enough lanes.
  }

-- | What is nested deeper is drawn in the last lane, one over the other.
maxLanes :: Int
maxLanes = 64

-- A span with all that is in it. It occupies that number of lanes from its own downwards, from
-- left to right (of all that is in it: after a loss of events that may be more than its own).
data Block = Block !Placed !Int !Double !Double [(Int, Block)]

-- | The lane of each span, given the pixel where a span begins and ends. What is in a span is in
-- lanes below it; siblings that overlap in time are in lanes of their own.
place :: (Node -> (Double, Double)) -> [Node] -> [Placed]
place pixels = absolute . fst . pack . map block
 where
  block n =
    Block
      (Placed n 0 left right False)
      height
      (minimum (left : map leftOf inner))
      (maximum (right : map rightOf inner))
      packed
   where
    (left, right) = pixels n
    inner = map block (nodeChildren n)
    (packed, below) = pack inner
    height = min maxLanes (1 + below)
  leftOf (Block _ _ l _ _) = l
  rightOf (Block _ _ _ r _) = r
  absolute = foldr (at 0) []
  at lane (offset, Block p _ _ _ inner) rest =
    p {placedLane = min lowest here, placedBelow = here >= lowest} : foldr (at (here + 1)) rest inner
   where
    here = min (lowest + 1) (lane + offset)
    lowest = maxLanes - 1

-- Each block in the first lanes that are free, and how many lanes that takes.
pack :: [Block] -> ([(Int, Block)], Int)
pack blocks = (reverse packed, lanes)
 where
  (packed, lanes, _) = foldl' add ([], 0, IntMap.empty) (sortOn (\(Block _ _ l _ _) -> l) blocks)
  add (done, used, ends) b@(Block _ height left right _) =
    ( (offset, b) : done
    , max used (offset + height)
    , foldl' (\known lane -> IntMap.insertWith max lane right known) ends [offset .. offset + height - 1]
    )
   where
    offset = min (maxLanes - 1) (firstFree ends height left 0)

firstFree :: IntMap Double -> Int -> Double -> Int -> Int
firstFree ends height left = from
 where
  from lane
    | lane >= maxLanes = lane
    | otherwise = case filter occupied [lane .. lane + height - 1] of
        [] -> lane
        l -> from (last l + 1)
  occupied lane = maybe False (> left) (IntMap.lookup lane ends)

-- | A span, or several with the same outcome that are drawn as one.
data Mark = Mark
  { markLane :: !Int
  , markOutcome :: !SpanOutcome
  , markLeft :: !Double
  , markRight :: !Double
  , markNode :: !Node
  -- ^ The first span.
  , markCount :: !Int
  , markNames :: [String]
  -- ^ Some of the names, without repetition.
  }

-- | Several spans are drawn as one.
isMerged :: Mark -> Bool
isMerged m = markCount m > 1

-- | The marks of the timeline, from left to right in each lane. Spans narrower than a pixel are
-- merged with their neighbours of the same outcome; if there would be more marks than the given number, those of two
-- pixels, of four, and so on. Marks of what failed, faulted, or was stopped are never part of a
-- mark of another outcome.
marks :: (Node -> SpanOutcome) -> Int -> [Placed] -> [Mark]
marks outcomeOf budget placed = case filter few attempts of
  enough : _ -> enough
  [] -> last attempts
 where
  attempts = map (\w -> mergedBelow outcomeOf w placed) (takeWhile (<= 256) (iterate (* 2) 1))
  few = null . drop budget

mergedBelow :: (Node -> SpanOutcome) -> Double -> [Placed] -> [Mark]
mergedBelow outcomeOf width placed = sortOn position (map single wide ++ concatMap merge (Map.toList narrow))
 where
  position m = (markLane m, markLeft m)
  isWide p = not (placedBelow p) && placedRight p - placedLeft p >= width
  wide = filter isWide placed
  narrow =
    Map.fromListWith
      (++)
      [((placedLane p, outcomeOf (placedNode p)), [p]) | p <- reverse placed, not (isWide p)]
  merge ((_, outcome), ps) = runs outcome (map single (sortOn placedLeft ps))
  runs _ [] = []
  runs outcome (m : rest) = extend outcome m rest
  extend _ m [] = [m]
  extend outcome m (next : rest)
    | near outcome m next = extend outcome (together m next) rest
    | otherwise = m : extend outcome next rest
  -- A merged mark of successes may be long. It does not go from one parent to the next, if that
  -- can be seen. Other marks stay as narrow as what they stand for.
  near Success m next =
    markLeft next - markRight m < width
      && (sameParent || markRight m - markLeft m < 24 || markLeft next < markRight m - width)
   where
    sameParent = spanParent (nodeSpan (markNode next)) == spanParent (nodeSpan (markNode m))
  near _ m next = markLeft next - markLeft m < max 2 width
  together m next =
    m
      { markRight = max (markRight m) (markRight next)
      , markCount = markCount m + markCount next
      , markNames = if length (markNames m) < 4 then nub (markNames m ++ markNames next) else markNames m
      }
  -- (Of what lies below others the end is marked, unless it succeeded.)
  single p =
    Mark
      { markLane = placedLane p
      , markOutcome = outcome
      , markLeft = if placedBelow p && outcome /= Success then placedRight p - 2 else placedLeft p
      , markRight = placedRight p
      , markNode = placedNode p
      , markCount = 1
      , markNames = [take 200 (spanName (nodeSpan (placedNode p)))]
      }
   where
    outcome = outcomeOf (placedNode p)
