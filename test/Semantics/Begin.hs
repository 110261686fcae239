{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- The initial states of programs.
module Semantics.Begin
  ( initial
  , begin
  , opened
  , andThen
  , orElse
  , continued
  , inSlot
  , serving
  , ended
  , thread
  ) where

import qualified Data.Map.Strict as Map
import qualified Data.Set as Set

import Semantics.Program
import Semantics.Source
import Semantics.State
import Semantics.Verdict

-- | The initial state of a world.
initial :: World -> State
initial world =
  State
    { now = start
    , running = (if usesMessages (program world) then Closing else id) $ case caller world of
        Operator ->
          Waiting
            Race
            [ thread start "firstOf: 1" (program world)
            , Thread "firstOf: 2" (Live NotStarted (Changing (changes world) (cancelAt world)))
            ]
        PlainThread _ later ->
          Called NoRequest (Starting (program world)) (changes world) [cancelAt world, cancelAt world + later]
    }
 where
  start =
    Now
      { clock = 0
      , levels = Map.fromList ((messages, At 0) : conditions world)
      , calls = Map.empty
      , shared = []
      , childResults = Map.empty
      , childStopRequests = Set.empty
      , abandoned = []
      }

-- | The state of a program that is about to run.
begin :: Now -> Program -> Running
begin t p = case p of
  Do name scripts -> Calling name scripts
  Pure value -> Over (Succeeded value)
  Sleep n -> if n > 0 then Sleeping (clock t + n) else Over (Succeeded Unit)
  Then first second -> andThen t (begin t first) second
  Else first second -> orElse t (begin t first) second
  Attempt n act
    | n <= 0 -> Over (FailedWith noAlternative)
    | n == 1 -> begin t act
    | otherwise -> begin t (act `Else` Attempt (n - 1) act)
  FallbackOver [] -> Over (FailedWith noAlternative)
  FallbackOver [act] -> begin t act
  FallbackOver (act : acts) -> begin t (act `Else` FallbackOver acts)
  Retrying [] act -> begin t act
  Retrying (wait : later) act -> begin t (act `Else` (Sleep wait `Then` Retrying later act))
  Every interval act -> inSlot t interval (clock t) act (begin t act)
  Deliver -> Delivering
  HandleNext act -> Entering (Taking True act)
  Parallel left right -> Waiting Race [thread t "parallel: left" (void left), thread t "parallel: right" (void right)]
  Both left right -> Waiting Gather [thread t "both: left" left, thread t "both: right" right] `AndThen` Pure Unit
  FirstOf [] -> Over (FailedWith noAlternative)
  FirstOf acts -> Waiting Race (numbered "firstOf: " acts)
  AllOf acts -> Waiting Gather (numbered "allOf: " acts)
  Decide choice acts chosen -> case chosenBy choice (Nothing <$ acts) of
    Just (Succeeded _) -> begin t chosen
    Just wrong -> Over wrong
    Nothing -> Waiting (Choose choice) (numbered "decide: " acts) `AndThen` chosen
  Scoped body -> Waiting Nursery [thread t "scoped: body" body]
  Fork act -> Forking act Nothing
  Await act meanwhile -> Forking act (Just (False, meanwhile))
  StopChild act meanwhile -> Forking act (Just (True, meanwhile))
  Timeout most _ -> before most
  CleanupWithin most _ -> Entering (Uninterruptibly (before most))
  Abandoning most act -> Waiting (Abandon most) [thread t "abandoning: branch" act]
  _ | any usesShared (signals p) -> Opening p
    | otherwise -> opened t p
 where
  void act = act `Then` Pure Unit
  before most = Reacting p (Deadline (clock t + most)) Always (Choosing FirstRead)
  numbered operator acts = [thread t (operator ++ show n) act | (n, act) <- zip [1 :: Int ..] acts]

-- | An operator on signals, which opens its signal.
opened :: Now -> Program -> Running
opened t p = case p of
  WithShared signal body -> Sharing (open t signal) (thread t "withShared: body" body)
  TeleoReactive rules -> following (startSource t (Joined FirstHolding (map (unstarted . fst) rules)))
  OnMessage _ _ -> following (Watching messages)
  MessageRule r _ _ s _ -> following (startSource t (Joined FirstHolding [unstarted r, Watching messages, unstarted s]))
  _ -> case signals p of
    signal : _ -> following (open t signal)
    [] -> error "opened: this operator has no signal"
 where
  following source = Reacting p source (viewOf t source) (Choosing FirstRead)

andThen, orElse :: Now -> Running -> Program -> Running
andThen t (Over (Succeeded _)) second = continued t second
andThen _ (Over other) _ = Over other
andThen _ first second = first `AndThen` second
orElse t (Over (FailedWith _)) second = continued t second
orElse _ (Over other) _ = Over other
orElse _ first second = first `OrElse` second

-- | What runs after something else. If it fails at once, that is after the first has ended: there a request is
-- received that the first did not receive. (And one that comes only then, as in reality; the simulator has no
-- scheduling point there.)
continued :: Now -> Program -> Running
continued t second = case begin t second of
  Over (FailedWith _) -> Starting second
  begun -> begun

-- | The run of a program that runs again in each slot: when it has succeeded, the next slot is awaited. Slots that
-- were missed by then are skipped.
inSlot :: Now -> Ticks -> Ticks -> Program -> Running -> Running
inSlot t interval from act = \case
  Over (Succeeded _) -> AwaitingSlot interval (until (>= clock t) (+ interval) (from + interval)) act
  Over wrong -> Over wrong
  r -> InSlot interval from act r

-- | The run of a rule that has each message handled by the program: after one the next is awaited.
serving :: Program -> Running -> Running
serving handler = \case
  Over (Succeeded _) -> Serving handler Nothing
  Over wrong -> Over wrong
  r -> Serving handler (Just r)

ended :: Name -> Ending -> Result
ended name = \case
  Succeeds n -> Succeeded (Number n)
  Fails -> FailedWith name
  Faults -> FaultedWith name

-- | A new thread, whose stop may be requested before its first step.
thread :: Now -> BranchLabel -> Program -> Thread
thread t label p = Thread label (Live NotStarted starting)
 where
  starting = if canWait begun then begun else Starting p
  begun = begin t p
  -- Until the program starts branches or ends, it makes no difference whether it has begun.
  -- Then it has begun, which keeps the number of states small.
  canWait = \case
    Calling _ _ -> True
    Forking _ _ -> True
    Opening _ -> True
    Reacting {} -> True
    first `AndThen` _ -> canWait first
    first `OrElse` _ -> canWait first
    _ -> False
