{-# LANGUAGE BangPatterns #-}

-- |
-- How schedules begin that an exhaustive search has yet to try.
--
-- There are many, and each is found during a run that is over when it is tried. So nothing
-- in a prefix is lazy: a thunk would keep the threads of that run. Prefixes that were found
-- in the same run share their beginning; one costs 12 words in the queue.
module Behavior.Internal.Sim.Prefix
  ( Prefix
  , emptyPrefix
  , choices
  , choiceCount
  , queueAlternatives
  ) where

import Behavior.Internal.Sim.Policy (Decision (..))

-- | The choices that differ from the usual ones, and how many pre-emptions may follow.
data Prefix = Prefix !Int !Choices

-- | The number of a scheduling point and of the thread that runs there, the latest first.
data Choices
  = NoChoice
  | Choice !Int !Int !Choices

-- | No choice yet, and the given number of pre-emptions.
emptyPrefix :: Int -> Prefix
emptyPrefix preemptions = Prefix preemptions NoChoice

-- | The earliest first.
choices :: Prefix -> [(Int, Int)]
choices (Prefix _ latestFirst) = go [] latestFirst
 where
  go earlier NoChoice = earlier
  go earlier (Choice p thread before) = go ((p, thread) : earlier) before

choiceCount :: Prefix -> Int
choiceCount = length . choices

-- | Puts the prefix, continued by each unusual choice that this decision allows, in front of
-- the queue.
queueAlternatives :: Prefix -> Decision -> [Prefix] -> [Prefix]
queueAlternatives (Prefix preemptions before) d queue
  | preemptions < cost = queue
  | otherwise = foldr add queue (candidates d)
 where
  cost = if canGoOn d then 1 else 0
  add thread !rest
    | thread == usual d = rest
    | otherwise =
        let !continued = Prefix (preemptions - cost) (Choice (decisionPoint d) thread before)
         in continued : rest
