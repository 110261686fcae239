{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Paths of the relation: whether a timeline belongs to one, and all that there are.
module Semantics.Path
  ( -- * Is it a path?
    Seen (..)
  , End (..)
  , explains
  , Verdict (..)

    -- * All paths
  , paths

    -- * What is observed
  , everything
  , whatIsDone
  ) where

import Control.Monad (foldM)
import Data.List (foldl')
import qualified Data.Map.Strict as Map
import Data.Maybe (mapMaybe)
import Data.Set (Set)
import qualified Data.Set as Set

import Semantics.Begin (initial)
import Semantics.Program
import Semantics.State (Now (clock), Running (Over), State (..))
import Semantics.Step

-- | The observed timeline of a run, and how the run ended.
data Seen = Seen
  { timeline :: Timeline
  , end :: End
  }
  deriving (Eq, Ord, Show)

data End
  = Gave Ticks Result
  | -- | No step is possible, now or later.
    Deadlock
  | -- | The run was cut off at this time.
    Unknown Ticks
  deriving (Eq, Ord, Show)

data Verdict
  = Possible
  | -- | The rest of the timeline that the relation does not allow, and what it allows instead
    -- of the first transition of that.
    Impossible Timeline [(Ticks, Transition)]
  | -- | No path ends like that; these are the possible ends.
    ImpossibleEnd [End]
  | -- | There are more states than the fuel allows.
    OutOfFuel
  deriving (Eq, Show)

-- | Whether the relation allows the timeline for this world. The second argument selects the
-- observable transitions.
explains :: Int -> (Transition -> Bool) -> World -> Seen -> Verdict
explains fuel visible world seen = go (Set.singleton (initial world)) (filter (visible . snd) (timeline seen))
 where
  go states = \case
    [] -> case silently fuel slip visible (upTo (end seen)) states of
      Nothing -> OutOfFuel
      Just these
        | end seen `elem` results -> Possible
        | Unknown t <- end seen, any (goesOnAt t) these -> Possible
        | otherwise -> ImpossibleEnd results
       where
        results = mapMaybe endOf (Set.toList these)
    rest@((t, transition) : later) -> case still t of
      Nothing -> OutOfFuel
      Just these -> case [s' | s <- at t these, (e, s') <- step s, e == transition] of
        [] -> Impossible rest [(clock (now s), e) | s <- Set.toList these, (e, _) <- step s, visible e]
        next -> go (Set.fromList next) later
   where
    still t = silently fuel slip visible (Just t) states
  slip = slippage world
  upTo = \case
    Gave t _ -> Just t
    Unknown t -> Just t
    Deadlock -> Nothing
  at t = filter ((== t) . clock . now) . Set.toList

-- | Every timeline that the relation allows, with its end. Nothing: more than fuel, or one that is longer than
-- that. (One that does not end, is: @every@ goes on after a stop request despite which its action completed.)
paths :: Int -> (Transition -> Bool) -> World -> Maybe (Set Seen)
paths fuel visible world = Set.fromList <$> go [] (Set.singleton (initial world))
 where
  slip = slippage world
  go past states = do
    these <- silently fuel slip visible Nothing states
    let results = Set.fromList (mapMaybe endOf (Set.toList these))
        next =
          Map.fromListWith Set.union $
            [((clock (now s), e), Set.singleton s') | s <- Set.toList these, (e, s') <- step s, visible e]
        here = [Seen {timeline = reverse past, end = e} | e <- Set.toList results]
    foldM
      (\found (seen, states') -> do
          more <- if length past >= fuel then Nothing else go (seen : past) states'
          if length found > fuel then Nothing else Just (more ++ found))
      here
      (Map.toList next)

-- | All states that are reached without an observable transition, up to the given time.
silently :: Int -> Ticks -> (Transition -> Bool) -> Maybe Ticks -> Set State -> Maybe (Set State)
silently fuel slip visible limit states = go states (Set.toList states)
 where
  go known = \case
    [] -> Just known
    s : others
      | Set.size known > fuel -> Nothing
      | otherwise ->
          let (known', others') = foldl' add (known, others) (quietly s) in go known' others'
  -- (To insert and to compare the sizes costs half of what it costs to look first.)
  add (known, others) s
    | Set.size known' > Set.size known = (known', s : others)
    | otherwise = (known, others)
   where
    known' = Set.insert s known
  quietly s = case step s of
    [] -> [later | later <- pass slip s, maybe True (clock (now later) <=) limit]
    next -> [s' | (e, s') <- next, not (visible e)]

-- | How the run has ended, if it has.
endOf :: State -> Maybe End
endOf s = case running s of
  Over r -> Just (Gave (clock (now s)) r)
  _ | null (step s), null (pass 0 s) -> Just Deadlock
  _ -> Nothing

-- | Whether it has not ended, and no step is left at this time. (A deadlock does not end
-- either.)
goesOnAt :: Ticks -> State -> Bool
goesOnAt t s = case running s of
  Over _ -> False
  _ -> null (step s) && all ((> t) . clock . now) (pass 0 s)

-- | Whether a transition is observed.
everything, whatIsDone :: Transition -> Bool
everything = (/= Silent)
whatIsDone = \case
  Silent -> False
  IsOver _ -> False
  _ -> True
