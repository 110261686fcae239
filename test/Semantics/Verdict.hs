-- |
-- What operators decide when they look.
module Semantics.Verdict
  ( -- * What comes of the branches
    verdict
  , conclude
  , concluding
  , outcome

    -- * What to do for a signal
  , valueOf
  , reaction
  , nameOf
  ) where

import Data.List (find)
import Data.Maybe (mapMaybe)

import Semantics.Program
import Semantics.Source
import Semantics.State

-- * What comes of the branches

-- | What an operator makes of its branches when it looks.
verdict :: Operator -> [Thread] -> Maybe Result
verdict operator threads = case operator of
  -- The first to finish; on a tie the left one.
  Race -> firstOf ends'
  Share -> firstOf ends'
  -- The first that does not complete; on a tie the left one.
  Gather
    | all completed threads -> Just (Succeeded (Several [value | Succeeded value <- ends']))
    | otherwise -> firstOf wrongs
  -- The body, however it ends; or what was forked, when it goes wrong (which it does not
  -- when it is stopped).
  Nursery -> case threads of
    body : _ | over body -> endOf body
    _ -> firstOf (filter (/= Stopped Nothing) wrongs)
  React -> Nothing
 where
  ends' = mapMaybe endOf threads
  wrongs = mapMaybe endOf (filter (not . completed) threads)
  firstOf = find (const True)

-- | Having come to a verdict, an operator asks all that still runs to stop, at once.
conclude :: Operator -> Result -> Source -> [Thread] -> Running
conclude operator result source threads =
  concluding operator result (askSource source) (map ask threads)

-- | ... and waits until all has ended. Of those that have, only faults matter; but a
-- body may still look at what is shared.
concluding :: Operator -> Result -> Source -> [Thread] -> Running
concluding operator result source threads
  | Stopped _ <- result, rested kept, all over living = Over (outcome operator result kept living)
  | otherwise = Concluding operator result kept living
 where
  living = filter (not . harmless) threads
  kept
    | operator == Share, not (all over living) = source
    | otherwise = remaining source
  harmless thread' = over thread' && null (faultOf thread')

-- | The caller's cancellation comes first, then the leftmost fault, then the verdict.
outcome :: Operator -> Result -> Source -> [Thread] -> Result
outcome operator result source threads = case (result, faults) of
  (Stopped _, fault : _) -> Stopped (Just fault)
  (_, fault : _) -> Faulted fault
  _ -> result
 where
  faults
    -- The one starts its body first, the others their sensors.
    | operator == Share = concatMap faultOf threads ++ faultsOf source
    | otherwise = faultsOf source ++ concatMap faultOf threads

-- * What to do for a signal

-- | What an operator follows of the value of its signal.
valueOf :: Program -> Int -> Int
valueOf p value = case p of
  Switch {} -> value
  TeleoReactive _ -> value
  _ -> fromEnum (holds value)

-- | What is to be done for the value of the signal.
reaction :: Program -> Int -> Reaction
reaction p value = case p of
  RSelect _ left right -> Run (if isTrue then left else right)
  Monitor _ recovery task -> if isTrue then RunToEnd recovery else Run task
  Switch _ branches -> Run (branches !! max 0 (min value (length branches - 1)))
  TeleoReactive rules -> if value < 0 then Idle else Run (snd (rules !! value))
  WaitUntil _ -> if isTrue then Conclude (Succeeded Unit) else Idle
  WhileHolding _ act -> if isTrue then Run act else Conclude (Failed doesNotHold)
  Timeout most act -> if isTrue then Conclude (Failed (timedOut most)) else Run act
  _ -> Idle
 where
  isTrue = holds value

-- | The name of the branch for a value.
nameOf :: Program -> Int -> Label
nameOf p value = case p of
  RSelect {} -> if holds value then "rSelect: left" else "rSelect: right"
  Monitor {} -> "monitor: task"
  Switch {} -> "switch: branch"
  TeleoReactive _ -> "teleoReactive: rule " ++ show (value + 1)
  WhileHolding {} -> "whileHolding: branch"
  _ -> "timeout: branch"
