{-# OPTIONS_GHC -O1 #-}
-- |
-- The decisions of operators.
module Semantics.Verdict
  ( -- * Verdicts on branches
    verdict
  , chosenBy
  , conclude
  , concluding
  , outcome

    -- * Reactions to signals
  , valueOf
  , response
  , nameOf
  , recoveryOf
  ) where

import Data.List (find)
import Data.Maybe (catMaybes, mapMaybe)

import Semantics.Program
import Semantics.Source
import Semantics.State

-- * Verdicts on branches

-- | The verdict of an operator when it reads the state of its branches.
verdict :: Operator -> [Thread] -> Maybe Result
verdict operator threads = case operator of
  -- The first to finish; on a tie the left one.
  Race -> firstOf results
  Abandon _ -> firstOf results
  Share -> firstOf results
  -- The first that does not complete; on a tie the left one.
  Gather
    | all completed threads -> Just (Succeeded (Several [value | Succeeded value <- results]))
    | otherwise -> firstOf wrongs
  -- A fault; or the choice.
  Choose choice
    | Just fault <- firstOf [result | result@(FaultedWith _) <- results] -> Just fault
    | Just chosen <- chosenBy choice (map endOf threads) -> Just chosen
    | all over threads -> Just (FaultedWith noneChosen)
    | otherwise -> Nothing
  -- The body, however it ends; or a child that fails or faults (not one that stops).
  Nursery -> case threads of
    body : _ | over body -> endOf body
    _ -> firstOf (filter (/= Stopped Nothing) wrongs)
  React -> Nothing
 where
  results = mapMaybe endOf threads
  wrongs = mapMaybe endOf (filter (not . completed) threads)
  firstOf = find (const True)

-- | Whether, given these ends, 'Decide' runs its last program, or fails; if it has chosen.
chosenBy :: Choice -> [Maybe Result] -> Maybe Result
chosenBy choice results = case choice of
  AtLeast m
    | succeeded >= m -> Just (Succeeded Unit)
    | succeeded + length (filter (== Nothing) results) < m -> Just (FailedWith tooFew)
  FirstEnd | result : _ <- catMaybes results -> Just $ case result of
    Succeeded _ -> Succeeded Unit
    wrong -> wrong
  _ -> Nothing
 where
  succeeded = length [() | Just (Succeeded _) <- results]

-- | With a verdict, an operator requests the stop of all that still runs, at once.
conclude :: Operator -> Result -> Source -> [Thread] -> Running
conclude operator result source threads =
  concluding operator result (requestStopOfSource source) (map requestStop threads)

-- | ... and waits until all has ended. Of the threads that have ended, only those with faults
-- are kept; but a body may still read the shared source.
concluding :: Operator -> Result -> Source -> [Thread] -> Running
concluding operator result source threads
  | Stopped _ <- result, allStopped kept, all over unfinished = Over (outcome operator result kept unfinished)
  | otherwise = Concluding operator result kept unfinished
 where
  unfinished = filter (not . harmless) threads
  kept
    | operator == Share, not (all over unfinished) = source
    | otherwise = remaining source
  harmless child = over child && null (faultOf child)

-- | The outcome is, in this order, the caller's cancellation, the leftmost fault, the
-- verdict.
outcome :: Operator -> Result -> Source -> [Thread] -> Result
outcome operator result source threads = case (result, faults) of
  (Stopped _, fault : _) -> Stopped (Just fault)
  (_, fault : _) -> FaultedWith fault
  _ -> result
 where
  faults
    -- 'Share' starts its body first, the others start their sensors first.
    | operator == Share = concatMap faultOf threads ++ pollerFaults source
    | otherwise = pollerFaults source ++ concatMap faultOf threads

-- * Reactions to signals

-- | The part of the signal's value on which the operator depends.
valueOf :: Program -> Int -> Int
valueOf p value = case p of
  Switch {} -> value
  TeleoReactive _ -> value
  MessageRule {} -> value
  _ -> fromEnum (holds value)

-- | The response to the value of the signal.
response :: Program -> Int -> Response
response p value = case p of
  RSelect _ left right -> Run (if isTrue then left else right)
  Monitor _ recovery task -> if isTrue then RunToEnd recovery else Run task
  OnMessage handler task -> if isTrue then RunToEnd handler else Run task
  InsteadWhen _ emergency act -> if isTrue then RunToEnd emergency else Run act
  Switch _ branches -> Run (branches !! max 0 (min value (length branches - 1)))
  TeleoReactive rules -> if value < 0 then Idle else Run (snd (rules !! value))
  MessageRule _ first handler _ third -> if value < 0 then Idle else Run ([first, handler, third] !! value)
  WaitUntil _ -> if isTrue then Conclude (Succeeded Unit) else Idle
  WhileHolding _ act -> if isTrue then Run act else Conclude (FailedWith doesNotHold)
  CleanupWithin _ act -> if isTrue then Conclude (Succeeded Unit) else Run act
  Timeout most act -> if isTrue then Conclude (FailedWith (timedOut most)) else Run act
  _ -> Idle
 where
  isTrue = holds value

-- | The name of the branch for a value.
nameOf :: Program -> Int -> BranchLabel
nameOf p value = case p of
  RSelect {} -> if holds value then "rSelect: left" else "rSelect: right"
  Monitor {} -> "monitor: task"
  InsteadWhen {} -> "insteadWhen: branch"
  OnMessage {} -> "onMessage: task"
  Switch {} -> "switch: branch"
  TeleoReactive _ -> "teleoReactive: rule " ++ show (value + 1)
  MessageRule {} -> "teleoReactive: rule " ++ show (value + 1)
  WhileHolding {} -> "whileHolding: branch"
  CleanupWithin {} -> "cleanupWithin: branch"
  _ -> "timeout: branch"

-- | The name of the branch that runs to its end.
recoveryOf :: Program -> BranchLabel
recoveryOf p = case p of
  InsteadWhen {} -> "insteadWhen: emergency"
  OnMessage {} -> "onMessage: handler"
  _ -> "monitor: recovery"
