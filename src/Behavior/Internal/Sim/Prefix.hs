{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The beginnings of the schedules that a search has yet to try.
--
-- There are many. Each is found during one run, and tried after that run has ended. So nothing
-- in the queue is lazy: a thunk would keep the threads of that run alive. A decision costs about
-- 20 words in the queue, however many threads were enabled, and the decisions of one run share
-- the beginning of its schedule.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Prefix
  ( -- * Prefixes
    Prefix
  , emptyPrefix
  , choices
  , choiceCount

    -- * The queue
  , Alternatives
  , alternatives
  , nextPrefix
  ) where

import Data.IntSet (IntSet)
import qualified Data.IntSet as IntSet

import Behavior.Internal.Sim.Policy (Decision (..))

-- | The choices that deviate from the non-preemptive schedule, and how many pre-emptions may
-- follow them.
data Prefix = Prefix !Int !Choices

-- | The number of a scheduling point, and of the thread that runs there; the latest first.
data Choices
  = NoChoice
  | Choice !Int !Int !Choices

-- | No choice yet, and the given number of pre-emptions.
emptyPrefix :: Int -> Prefix
emptyPrefix preemptions = Prefix preemptions NoChoice

-- | The choices, the earliest first: the number of a scheduling point, and of the thread
-- that runs there.
choices :: Prefix -> [(Int, Int)]
choices (Prefix _ latestFirst) = go [] latestFirst
 where
  go later NoChoice = later
  go later (Choice p thread before) = go ((p, thread) : later) before

-- | How many choices there are.
choiceCount :: Prefix -> Int
choiceCount = length . choices

-- | The other enabled threads at a scheduling point: how many pre-emptions may follow, the
-- number of the point, the threads, and the choices before it.
data Alternatives = Alternatives !Int !Int !IntSet !Choices

-- | The other choices at this decision, which comes after the prefix, if the number of
-- pre-emptions allows them.
alternatives :: Prefix -> Decision -> Maybe Alternatives
alternatives (Prefix preemptions before) d
  | preemptions < cost || IntSet.null others = Nothing
  | otherwise = Just $! Alternatives (preemptions - cost) (decisionPoint d) others before
 where
  cost = if canGoOn d then 1 else 0
  others = IntSet.delete (usual d) (IntSet.fromList (candidates d))

-- | The next prefix, and the rest of the queue. (The threads of one decision are tried in
-- the order of their numbers.)
nextPrefix :: [Alternatives] -> Maybe (Prefix, [Alternatives])
nextPrefix [] = Nothing
nextPrefix (Alternatives preemptions p threads before : queue) =
  case IntSet.minView threads of
    Nothing -> nextPrefix queue
    Just (thread, others) ->
      let left = Alternatives preemptions p others before
       in left `seq` Just (Prefix preemptions (Choice p thread before), left : queue)
