{-# LANGUAGE LambdaCase #-}

-- |
-- What operators decide when they look.
module Semantics.Verdict
  ( -- * What comes of the branches
    verdict
  , conclude
  , concluding
  , outcome

    -- * What to do for a signal
  , look
  , valueOf
  , reaction
  , nameOf
  ) where

import Data.List (find, findIndex)
import qualified Data.Map.Strict as Map
import Data.Maybe (fromMaybe, mapMaybe)

import Semantics.Program
import Semantics.State

-- * What comes of the branches

-- | What an operator makes of its branches when it looks.
verdict :: Operator -> [Thread] -> Maybe Result
verdict operator threads = case operator of
  -- The first to finish; on a tie the left one.
  Race -> firstOf ends'
  -- The first that does not complete; on a tie the left one.
  Gather
    | all completed threads -> Just (Succeeded (Several [value | Succeeded value <- ends']))
    | otherwise -> firstOf wrongs
  -- The body, however it ends; or what was forked, when it goes wrong.
  Nursery -> case threads of
    body : _ | over body -> endOf body
    _ -> firstOf wrongs
  React -> Nothing
 where
  ends' = mapMaybe endOf threads
  wrongs = mapMaybe endOf (filter (not . completed) threads)
  firstOf = find (const True)

-- | Having come to a verdict, an operator asks all that still runs to stop, at once.
conclude :: Operator -> Result -> [Sensor] -> [Thread] -> Running
conclude operator result sensors threads =
  concluding operator result (map askSensor sensors) (map ask threads)

-- | ... and waits until all has ended. Of those that have, only faults matter.
concluding :: Operator -> Result -> [Sensor] -> [Thread] -> Running
concluding operator result sensors threads
  | Stopped _ <- result, all rested living, all over remaining = Over (outcome result living remaining)
  | otherwise = Concluding operator result living remaining
 where
  living = filter (\s -> not (rested s) || faulted s) sensors
  remaining = filter (not . harmless) threads
  harmless thread' = over thread' && null (faultOf thread')

-- | The caller's cancellation comes first, then the leftmost fault, then the verdict.
outcome :: Result -> [Sensor] -> [Thread] -> Result
outcome result sensors threads = case (result, faults) of
  (Stopped _, fault : _) -> Stopped (Just fault)
  (_, fault : _) -> Faulted fault
  _ -> result
 where
  faults =
    [fault | Polling Poller {poll = Rested (Faulted fault)} <- sensors]
      ++ concatMap faultOf threads

-- * What to do for a signal

-- | A look at all the sensors. Nothing: there is no value yet.
look :: Now -> Moment -> [Sensor] -> Maybe (Either Result [Int])
look t moment = \case
  [] -> Just (Right [])
  s : others -> case lookAt s of
    Just (Right value) -> fmap (value :) <$> look t moment others
    Just (Left wrong) -> Just (Left wrong)
    Nothing -> Nothing
 where
  lookAt = \case
    Watching condition -> case (Map.lookup condition (levels t), moment) of
      (Just (At n), _) -> Just (Right n)
      (Just Failing, _) -> Just (Left (Failed condition))
      (Just Faulting, _) -> Just (Left (Faulted condition))
      (_, First) -> Nothing
      (_, Later) -> Just (Left (Failed noValue))
    Deadline end -> Just (Right (fromEnum (clock t >= end)))
    Polling s -> case newest s of
      Nothing -> Nothing
      Just (Succeeded value) -> Just (Right (number value))
      Just wrong -> Just (Left wrong)

-- | The one value that an operator follows.
valueOf :: Program -> [Int] -> Int
valueOf p values = case p of
  Switch {} -> sum values
  TeleoReactive _ -> fromMaybe (-1) (findIndex holds values)
  _ -> fromEnum (any holds values)

-- | What is to be done for the values of the signal.
reaction :: Program -> Int -> Reaction
reaction p value = case p of
  RSelect _ left right -> Run (if isTrue then left else right)
  Monitor _ recovery task -> if isTrue then RunToEnd recovery else Run task
  Switch _ branches -> Run (branches !! max 0 (min value (length branches - 1)))
  TeleoReactive rules -> if value < 0 then Idle else Run (snd (rules !! value))
  WaitUntil _ -> if isTrue then Conclude (Succeeded Unit) else Idle
  WhileHolding _ act -> if isTrue then Run act else Conclude (Failed doesNotHold)
  Timeout limit act -> if isTrue then Conclude (Failed (timedOut limit)) else Run act
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
