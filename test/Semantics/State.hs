{-# LANGUAGE LambdaCase #-}

-- |
-- The states that a program goes through.
module Semantics.State
  ( -- * States
    State (..)
  , Now (..)
  , Running (..)
  , Operator (..)
  , Thread (..)
  , Life (..)
  , Request (..)
  , Phase (..)
  , Moment (..)
  , Reaction (..)
  , Sensor (..)
  , Poller (..)
  , Poll (..)

    -- * Beginning
  , initial
  , begin
  , andThen
  , orElse
  , ended
  , thread

    -- * Threads
  , ask
  , asOutcome
  , endOf
  , over
  , completed
  , faultOf
  , threadsOf

    -- * Sensors
  , askSensor
  , asAskedNow
  , rested
  , faulted

    -- * Time
  , moments
  ) where

import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust, mapMaybe)

import Semantics.Program

data State = State
  { now :: Now
  , running :: Running
  }
  deriving (Eq, Ord, Show)

-- | What all that runs has in common.
data Now = Now
  { clock :: Ticks
  , levels :: Map Condition Level
  , calls :: Map Name Int
  -- ^ How often an action was called; those to come all follow the last script.
  }
  deriving (Eq, Ord, Show)

-- | How far a thread has come.
data Running
  = -- | It has not begun.
    Starting Program
  | -- | It is about to call an action.
    Calling Name [Script]
  | -- | The action does what it does until that moment.
    Acting Name Ticks Script
  | -- | It was asked to stop, and is busy with that until that moment. (Nothing: then it
    -- has stopped.)
    Cleaning Name Ticks (Maybe Ending)
  | Running `AndThen` Program
  | Running `OrElse` Program
  | -- | The operator waits for its branches.
    Looking Operator [Thread]
  | -- | The operator follows its signal.
    Reacting Program [Sensor] Phase
  | -- | The operator has come to a verdict, and waits for those whom it has asked to stop.
    Concluding Operator Result [Sensor] [Thread]
  | Forking Program
  | -- | What it forks has started.
    Forked
  | -- | The environment, with the changes to come.
    Changing [Change] Ticks
  | Over Result
  deriving (Eq, Ord, Show)

data Operator
  = Race
  | Gather
  | Nursery
  | React
  deriving (Eq, Ord, Show)

-- | A branch of an operator.
data Thread = Thread Label Life
  deriving (Eq, Ord, Show)

data Life
  = Living Request Running
  | -- | It has ended, but that is not yet known.
    Finished Result
  | Ended Result
  deriving (Eq, Ord, Show)

-- | A thread is asked to stop once at most.
data Request
  = Unasked
  | Asked
  | Heard
  deriving (Eq, Ord, Show)

-- | Where a reactive operator is.
data Phase
  = -- | Nothing runs: what the signal says now decides.
    Choosing Moment
  | -- | The reaction to this value is to wait for another.
    Idling Int
  | -- | The branch for this value runs.
    Following Int Thread
  | -- | The branch was asked to stop, so that this can come next.
    Switching Reaction Thread
  | -- | The recovery runs, and nothing else matters. Before it, perhaps, a branch ended
    -- wrongly.
    Recovering (Maybe Thread) Thread
  | -- | The recovery has ended; the sensors have to before they start afresh.
    Resting
  deriving (Eq, Ord, Show)

data Moment
  = First
  | Later
  deriving (Eq, Ord, Show)

data Reaction
  = Run Program
  | RunToEnd Program
  | Idle
  | Conclude Result
  deriving (Eq, Ord, Show)

-- | What a value of a signal comes from.
data Sensor
  = Watching Condition
  | Deadline Ticks
  | Polling Poller
  deriving (Eq, Ord, Show)

data Poller = Poller
  { period :: Ticks
  , sensor :: Program
  , slot :: Ticks
  -- ^ No reading starts before.
  , newest :: Maybe Result
  -- ^ Of the readings that count.
  , request :: Request
  , poll :: Poll
  }
  deriving (Eq, Ord, Show)

data Poll
  = Sleeping Ticks
  | Reading Counts Running
  | -- | It is there, but not yet known.
    Read Counts Result
  | Rested Result
  deriving (Eq, Ord, Show)

-- | Whether a reading counts: it does if it began after the operator last asked.
type Counts = Bool

-- * Beginning

-- | The program and its environment, about to begin.
initial :: World -> State
initial world =
  State
    { now = start
    , running =
        Looking
          Race
          [ thread start "firstOf: 1" (program world)
          , Thread "firstOf: 2" (Living Unasked environment)
          ]
    }
 where
  start = Now {clock = 0, levels = Map.fromList (conditions world), calls = Map.empty}
  environment = Changing (changes world) (patience world)

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
  Fork act -> Forking act
  RSelect signal _ _ -> following [signal]
  Monitor signal _ _ -> following [signal]
  Switch signal _ -> following [signal]
  TeleoReactive rules -> following (map fst rules)
  WaitUntil signal -> following [signal]
  WhileHolding signal _ -> following [signal]
  Timeout limit _ -> Reacting p [Deadline (clock t + limit)] (Choosing First)
 where
  void act = act `Then` Pure Unit
  numbered operator acts = [thread t (operator ++ show n) act | (n, act) <- zip [1 :: Int ..] acts]
  following signals = Reacting p (map (open t) signals) (Choosing First)

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
thread t label p = Thread label (Living Unasked starting)
 where
  starting = if canWait begun then begun else Starting p
  begun = begin t p
  -- As long as it has not started branches of its own, nor ended, there is no telling
  -- whether it has begun. So take it that it has: that keeps the states few.
  canWait = \case
    Calling _ _ -> True
    Forking _ -> True
    Reacting {} -> True
    first `AndThen` _ -> canWait first
    first `OrElse` _ -> canWait first
    _ -> False

open :: Now -> Signal -> Sensor
open t = \case
  Watched condition -> Watching condition
  Polled every act ->
    Polling
      Poller
        { period = every
        , sensor = act
        , slot = clock t
        , newest = Nothing
        , request = Unasked
        , poll = Sleeping (clock t)
        }

-- * Threads

-- | To ask one that was asked before, or has ended, changes nothing.
ask :: Thread -> Thread
ask = \case
  Thread label (Living Unasked r) -> Thread label (Living Asked r)
  other -> other

-- | Whoever asked for the stop takes out the fault that was met on the way.
asOutcome :: Result -> Result
asOutcome = \case
  Stopped (Just fault) -> Faulted fault
  other -> other

-- | How a thread ended, if that is known.
endOf :: Thread -> Maybe Result
endOf = \case
  Thread _ (Ended result) -> Just result
  _ -> Nothing

over, completed :: Thread -> Bool
over = isJust . endOf
completed thread' = case endOf thread' of
  Just (Succeeded _) -> True
  _ -> False

faultOf :: Thread -> [String]
faultOf thread' = [fault | Just (Faulted fault) <- [endOf thread']]

threadsOf :: Phase -> [Thread]
threadsOf = \case
  Following _ branch -> [branch]
  Switching _ branch -> [branch]
  Recovering before recovery -> maybe id (:) before [recovery]
  _ -> []

-- * Sensors

askSensor :: Sensor -> Sensor
askSensor = \case
  Polling s@Poller {request = Unasked} -> Polling s {request = Asked}
  other -> other

-- | From now on only readings count that begin from now on.
asAskedNow :: Sensor -> Sensor
asAskedNow = \case
  Polling s -> Polling s {newest = Nothing, poll = uncounted (poll s)}
  other -> other
 where
  uncounted = \case
    Reading _ r -> Reading False r
    Read _ result -> Read False result
    other -> other

rested, faulted :: Sensor -> Bool
rested = \case
  Polling Poller {poll = Rested _} -> True
  Polling _ -> False
  _ -> True
faulted = \case
  Polling Poller {poll = Rested (Faulted _)} -> True
  _ -> False

-- * Time

-- | The moments at which something is due.
moments :: Running -> [Ticks]
moments = \case
  Acting _ until' _ -> [until']
  Cleaning _ until' _ -> [until']
  first `AndThen` _ -> moments first
  first `OrElse` _ -> moments first
  Looking _ threads -> ofThreads threads
  Reacting _ sensors phase -> ofSensors sensors ++ ofThreads (threadsOf phase)
  Concluding _ _ sensors threads -> ofSensors sensors ++ ofThreads threads
  Changing (Change at _ _ : _) _ -> [at]
  Changing [] end -> [end]
  _ -> []
 where
  ofThreads threads = concat [moments r | Thread _ (Living _ r) <- threads]
  ofSensors = concat . mapMaybe ofSensor
  ofSensor = \case
    Deadline end -> Just [end]
    Polling Poller {poll = Sleeping until'} -> Just [until']
    Polling Poller {poll = Reading _ r} -> Just (moments r)
    _ -> Nothing
