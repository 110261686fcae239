{-# LANGUAGE LambdaCase #-}

-- |
-- How programs begin.
module Semantics.Begin
  ( initial
  , begin
  , opened
  , andThen
  , orElse
  , ended
  , thread
  ) where

import qualified Data.Map.Strict as Map
import qualified Data.Set as Set

import Semantics.Program
import Semantics.Source
import Semantics.State

-- | The program and its environment, about to begin.
initial :: World -> State
initial world =
  State
    { now = start
    , running = case caller world of
        Operator ->
          Looking
            Race
            [ thread start "firstOf: 1" (program world)
            , Thread "firstOf: 2" (Living Unborn (Changing (changes world) (patience world)))
            ]
        Stranger _ later ->
          Called Unasked (Starting (program world)) (changes world) [patience world, patience world + later]
    }
 where
  start = Now {clock = 0, levels = Map.fromList (conditions world), calls = Map.empty, shared = [], answers = Map.empty, retracted = Set.empty}

-- | A program that is about to run.
begin :: Now -> Program -> Running
begin t p = case p of
  Do name scripts -> Calling name scripts
  Pure value -> Over (Succeeded value)
  Then first second -> andThen t (begin t first) second
  Else first second -> orElse t (begin t first) second
  Attempt n act
    | n <= 0 -> Over (Failed nothingElse)
    | n == 1 -> begin t act
    | otherwise -> begin t (act `Else` Attempt (n - 1) act)
  FallbackOver [] -> Over (Failed nothingElse)
  FallbackOver [act] -> begin t act
  FallbackOver (act : acts) -> begin t (act `Else` FallbackOver acts)
  Parallel left right -> Looking Race [thread t "parallel: left" (void left), thread t "parallel: right" (void right)]
  Both left right -> Looking Gather [thread t "both: left" left, thread t "both: right" right] `AndThen` Pure Unit
  FirstOf [] -> Over (Failed nothingElse)
  FirstOf acts -> Looking Race (numbered "firstOf: " acts)
  AllOf acts -> Looking Gather (numbered "allOf: " acts)
  Scoped body -> Looking Nursery [thread t "scoped: body" body]
  Fork act -> Forking act Nothing
  Await act meanwhile -> Forking act (Just (False, meanwhile))
  Retract act meanwhile -> Forking act (Just (True, meanwhile))
  Timeout limit' _ -> Reacting p (Deadline (clock t + limit')) Always (Choosing First)
  _ | any borrows (signals p) -> Opening p
    | otherwise -> opened t p
 where
  void act = act `Then` Pure Unit
  numbered operator acts = [thread t (operator ++ show n) act | (n, act) <- zip [1 :: Int ..] acts]

-- | An operator on signals that is about to look.
opened :: Now -> Program -> Running
opened t p = case p of
  WithShared signal body -> Sharing (open t signal) (thread t "withShared: body" body)
  TeleoReactive rules -> following (startedAt t (Joined FirstHolding (map (made . fst) rules)))
  _ -> case signals p of
    signal : _ -> following (open t signal)
    [] -> error "opened: this operator has no signal"
 where
  following source = Reacting p source (viewOf t source) (Choosing First)

andThen, orElse :: Now -> Running -> Program -> Running
andThen t (Over (Succeeded _)) second = begin t second
andThen _ (Over other) _ = Over other
andThen _ first second = first `AndThen` second
orElse t (Over (Failed _)) second = begin t second
orElse _ (Over other) _ = Over other
orElse _ first second = first `OrElse` second

ended :: Name -> Ending -> Result
ended name = \case
  Succeeds n -> Succeeded (Number n)
  Fails -> Failed name
  Faults -> Faulted name

-- | A thread, which may be asked to stop before it does anything at all, even end.
thread :: Now -> Label -> Program -> Thread
thread t label p = Thread label (Living Unborn starting)
 where
  starting = if canWait begun then begun else Starting p
  begun = begin t p
  -- As long as it has not started branches of its own, nor ended, there is no telling
  -- whether it has begun. So take it that it has: that keeps the states few.
  canWait = \case
    Calling _ _ -> True
    Forking _ _ -> True
    Opening _ -> True
    Reacting {} -> True
    first `AndThen` _ -> canWait first
    first `OrElse` _ -> canWait first
    _ -> False
