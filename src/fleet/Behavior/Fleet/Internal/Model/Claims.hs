{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- The functions of the schema that start tasks.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Model.Claims
  ( claim
  ) where

import Control.Monad (forM)
import Data.List (sortOn)
import qualified Data.Map.Strict as Map
import Data.Maybe (fromMaybe, listToMaybe)
import Data.Ord (Down (..))
import qualified Data.Set as Set
import Data.UUID.Types (UUID)

import Behavior (Seconds)
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Model.Tables
import Behavior.Fleet.Internal.Model.Tasks (sweep, wake)

-- | Starts tasks, one for each of the robots. If it is asked again, the same.
claim :: Seconds -> Claiming -> Doing [Start]
claim at it = do
  requireRobots (forRobots it)
  requireTerm (forTerm it)
  known <- if isAgain it then startsOf at (claimNumber it) else pure []
  if null known then new else pure known
 where
  new = do
    served <- claimWaiting at it
    case drop (length served) (forRobots it) of
      [] -> pure served
      others -> do
        isDue <- getting (any (\row -> isOpen row && maybe False (<= at) (wakes row)) . Map.elems . rows)
        if isDue then (served ++) <$> (sweep at >> claimWaiting at it {forRobots = others}) else pure served

-- | What was started by this request, and runs: from now for its term.
startsOf :: Seconds -> UUID -> Doing [Start]
startsOf at number = do
  these <- getting (sortOn (lease . snd) . filter (isIts . snd) . Map.toList . rows)
  forM these $ \(n, row) -> do
    put n row {wakes = Just (at + term row)}
    pure (Start n (fromMaybe 0 (lease row)) (robot row) (key row) (taskInput (submitted row)) (taskStarts (task row)))
 where
  isIts row = taskState (task row) == Running && request row == Just number && maybe False (> at) (wakes row)

-- | The same, of those that wait already. (One whose deadline has passed dies, if it is in the way.)
claimWaiting :: Seconds -> Claiming -> Doing [Start]
claimWaiting at it = go (forRobots it)
 where
  go [] = pure []
  go (name : others) =
    getting (listToMaybe . sortOn order . filter (fits . snd) . Map.toList . rows) >>= \case
      Nothing -> pure []
      Just (n, row)
        | maybe False (<= at) (deadline row) -> wake at n row >> go (name : others)
        | otherwise -> do
            number <- nextNumberOf
            let before = task row
                started = before {taskState = Running, taskStarts = taskStarts before + 1, taskProgress = Nothing}
            put n row
              { task = started, lease = Just number, robot = name, term = forTerm it, request = Just (claimNumber it)
              , wakes = Just (at + forTerm it)
              }
            tellTask n row
            (Start n number name (key row) (taskInput (submitted row)) (taskStarts started) :) <$> go others
  order (n, row) = (Down (withPriority (submitted row)), n)
  fits row =
    taskState (task row) == Waiting
      && toQueue (submitted row) == fromQueue it
      && withNeeds (submitted row) `Set.isSubsetOf` withSkills it
