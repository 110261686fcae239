{-# LANGUAGE LambdaCase #-}

-- |
-- The meaning of the language, as a small-step relation.
--
-- A state is a clock, what the conditions are at, and how far the program has come.
-- The rules say what may happen next; where several may, any of them does. Time
-- passes only when nothing else can happen.
--
-- What runs side by side takes its steps in any order. In particular a branch that
-- has ended is not seen by its operator at once, a branch that was asked to stop
-- does not hear it at once, and in between others take their steps: all this is
-- \"the same instant\" and is where ties come from.
module Semantics.Step
  ( -- * States
    State (..)
  , Now (..)
  , Running (..)
  , Thread (..)
  , Sensor (..)
  , initial

    -- * The relation
  , step
  , pass
  ) where

import Data.List (find, findIndex)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (mapMaybe)

import Semantics.Program

-- * States

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
  = -- | It is about to call an action.
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
data Thread
  = Thread Request Running
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

-- | The program and its environment, about to begin.
initial :: World -> State
initial world =
  State
    { now = start
    , running = Looking Race [thread start (program world), Thread Unasked environment]
    }
 where
  start = Now {clock = 0, levels = Map.fromList (conditions world), calls = Map.empty}
  environment = Changing (changes world) (patience world)

-- * The relation

-- | What may happen next.
step :: State -> [(Event, State)]
step (State t r) = [(event, State t' r') | (Happens event, t', r') <- steps t r]

-- | Time passes, up to the next moment at which something can happen. Only for states
-- in which nothing else can.
pass :: State -> Maybe State
pass (State t r) = case filter (> clock t) (moments r) of
  [] -> Nothing
  later -> Just (State t {clock = minimum later} r)

-- | A step of a part of the program may also be one that is its surroundings' business.
data Label
  = Happens Event
  | Forks Program

type Steps a = [(Label, Now, a)]

silently :: Now -> a -> Steps a
silently t a = [(Happens Silent, t, a)]

steps :: Now -> Running -> Steps Running
steps t = \case
  Calling name scripts ->
    let n = Map.findWithDefault 0 name (calls t)
        script = scripts !! n
        called
          | n + 1 < length scripts = t {calls = Map.insert name (n + 1) (calls t)}
          | otherwise = t
     in [(Happens (name `Does` Begins), called, Acting name (clock t + takes script) script)]
  Acting name until' script ->
    [(Happens (name `Does` Ends (ends script)), t, Over (ended name (ends script))) | clock t >= until']
  Cleaning name until' how ->
    [ (Happens (name `Does` maybe Stops Ends how), t, Over (maybe (Stopped Nothing) (ended (cleanupOf name)) how))
    | clock t >= until'
    ]
  first `AndThen` second -> [(l, t', andThen t' r second) | (l, t', r) <- steps t first]
  first `OrElse` second -> [(l, t', orElse t' r second) | (l, t', r) <- steps t first]
  Looking operator threads ->
    case verdict operator threads of
      Just result -> silently t (conclude operator result [] threads)
      Nothing -> []
      ++ concatMap (serve operator) (oneOf (threadSteps t) threads)
  Reacting p sensors phase ->
    [(l, t', reacting t' p sensors' phase) | (l, t', sensors') <- oneOf (sensorSteps t) sensors]
      ++ reactions t p sensors phase
  Concluding operator result sensors threads
    | all rested sensors, all over threads -> silently t (Over (outcome result sensors threads))
    | otherwise ->
        [(l, t', concluding operator result sensors' threads) | (l, t', sensors') <- oneOf (sensorSteps t) sensors]
          ++ [ (if operator == Nursery then refuse l else l, t', concluding operator result sensors threads')
             | (l, t', threads') <- oneOf (threadSteps t) threads
             ]
  Forking p -> [(Forks p, t, Forked)]
  Forked -> silently t (Over (Succeeded Unit))
  Changing (Change at condition level : others) end ->
    [ (Happens (condition `Becomes` level), t {levels = Map.insert condition level (levels t)}, Changing others end)
    | clock t >= at
    ]
  Changing [] end -> if clock t >= end then silently t (Over (Succeeded timeIsUp)) else []
  Over _ -> []
 where
  serve Nursery (Forks p, t', threads)
    | Nothing <- verdict Nursery threads = [(Happens Silent, t', Looking Nursery (threads ++ [thread t' p]))]
    | otherwise = []
  serve Nursery (l, t', threads) = [(l, t', Looking Nursery (withoutCompleted threads))]
  serve operator (l, t', threads) = [(l, t', Looking operator threads)]
  -- What is forked while all is being stopped never starts.
  refuse = \case
    Forks _ -> Happens Silent
    l -> l
  withoutCompleted = \case
    main : forked -> main : filter (not . completed) forked
    [] -> []

-- | What may happen in one of several that run side by side.
oneOf :: (a -> Steps a) -> [a] -> Steps [a]
oneOf one = \case
  [] -> []
  a : as -> [(l, t, a' : as) | (l, t, a') <- one a] ++ [(l, t, a : as') | (l, t, as') <- oneOf one as]

-- ** Programs

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
  Parallel left right -> begin t (FirstOf [void left, void right])
  Both left right -> begin t (void (AllOf [left, right]))
  FirstOf [] -> Over (Failed nothingElse)
  FirstOf acts -> Looking Race (map (thread t) acts)
  AllOf acts -> Looking Gather (map (thread t) acts)
  Scoped body -> Looking Nursery [thread t body]
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

-- ** Being asked to stop

-- | What becomes of it if it hears the request now. Nothing: it cannot.
hear :: Now -> Running -> Maybe (Event, Running)
hear t = \case
  Calling _ _ -> stopped
  Acting name until' script
    | deaf (masking script) -> Nothing
    | otherwise -> Just (name `Does` Hears, respond name (whenAsked script))
   where
    deaf = \case
      Unmasked -> False
      Masked -> clock t >= until'
      Uninterruptible -> True
  Cleaning {} -> Nothing
  first `AndThen` second -> fmap (\r -> andThen t r second) <$> hear t first
  first `OrElse` second -> fmap (\r -> orElse t r second) <$> hear t first
  Looking operator threads -> Just (Silent, conclude operator (Stopped Nothing) [] threads)
  Reacting _ sensors phase -> Just (Silent, conclude React (Stopped Nothing) sensors (threadsOf phase))
  Concluding _ _ sensors threads
    | all rested sensors, all over threads -> Just (Silent, Over (outcome (Stopped Nothing) sensors threads))
    | otherwise -> Nothing
  Forking _ -> stopped
  Forked -> stopped
  Changing _ _ -> stopped
  Over _ -> Nothing
 where
  stopped = Just (Silent, Over (Stopped Nothing))
  respond name = \case
    StopsAtOnce -> Over (Stopped Nothing)
    StopsAfter n -> Cleaning name (clock t + n) Nothing
    EndsAfter n how -> Cleaning name (clock t + n) (Just how)

-- ** Branches

-- | A thread that may be asked to stop before it does anything at all, even end.
thread :: Now -> Program -> Thread
thread t = Thread Unasked . begin t

settled :: Request -> Running -> Thread
settled asked = \case
  Over result -> Finished (asOutcome result)
  r -> Thread asked r

-- | Whoever asked for the stop takes out the fault that was met on the way.
asOutcome :: Result -> Result
asOutcome = \case
  Stopped (Just fault) -> Faulted fault
  other -> other

threadSteps :: Now -> Thread -> Steps Thread
threadSteps t = \case
  Thread asked (Over result) ->
    silently t (Ended (asOutcome result)) ++ concat [silently t (Ended (Stopped Nothing)) | asked == Asked]
  Thread asked r ->
    [(l, t', settled asked r') | (l, t', r') <- steps t r]
      ++ [(Happens event, t, settled Heard r') | asked == Asked, Just (event, r') <- [hear t r]]
  Finished result -> silently t (Ended result)
  Ended _ -> []

-- | To ask one that was asked before, or has ended, changes nothing.
ask :: Thread -> Thread
ask = \case
  Thread Unasked r -> Thread Asked r
  other -> other

-- | When nothing but the end of the thread is waited for, it makes no difference
-- whether the end is known yet.
known :: Thread -> Thread
known = \case
  Finished result -> Ended result
  other -> other

over, completed :: Thread -> Bool
over = \case
  Ended _ -> True
  _ -> False
completed = \case
  Ended (Succeeded _) -> True
  _ -> False

-- ** Verdicts

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
    Ended result : _ -> Just result
    _ -> firstOf wrongs
  React -> Nothing
 where
  ends' = [result | Ended result <- threads]
  wrongs = [result | Ended result <- threads, not (completed (Ended result))]
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
  remaining = filter (not . harmless) (map known threads)
  harmless = \case
    Ended (Faulted _) -> False
    other -> over other

-- | The caller's cancellation comes first, then the leftmost fault, then the verdict.
outcome :: Result -> [Sensor] -> [Thread] -> Result
outcome result sensors threads = case (result, faults) of
  (Stopped _, fault : _) -> Stopped (Just fault)
  (_, fault : _) -> Faulted fault
  _ -> result
 where
  faults =
    [fault | Polling Poller {poll = Rested (Faulted fault)} <- sensors]
      ++ [fault | Ended (Faulted fault) <- threads]

-- ** Reactive operators

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

-- | The one value that an operator follows.
valueOf :: Program -> [Int] -> Int
valueOf p values = case p of
  Switch {} -> sum values
  TeleoReactive _ -> maybe (-1) id (findIndex holds values)
  _ -> fromEnum (any holds values)

reactions :: Now -> Program -> [Sensor] -> Phase -> Steps Running
reactions t p sensors phase = case phase of
  Choosing moment -> case look t moment sensors of
    Nothing -> []
    Just (Left wrong) -> silently t (conclude React wrong sensors [])
    Just (Right values) -> silently t (obey (valueOf p values))
  Idling old -> case look t Later sensors of
    Just (Left wrong) -> silently t (conclude React wrong sensors [])
    Just (Right values) | valueOf p values /= old -> silently t (obey (valueOf p values))
    _ -> []
  Following old branch ->
    inThread (Following old) branch
      -- A branch that has ended by itself is looked at first.
      ++ case (branch, look t Later sensors) of
        (Ended result, _) -> silently t (conclude React result sensors [branch])
        (_, Just (Left wrong)) -> silently t (switching (Conclude wrong) branch)
        (_, Just (Right values)) | valueOf p values /= old -> silently t (switching (reaction p (valueOf p values)) branch)
        _ -> []
  Switching next branch -> case branch of
    Ended result -> silently t (switched next result branch)
    _ -> inThread (Switching next . known) branch
  Recovering before recovery -> case recovery of
    Ended result -> silently t (recovered before result recovery)
    _ -> inThread (Recovering before . known) recovery
  Resting -> []
 where
  inThread inPlace branch = [(l, t', Reacting p sensors (inPlace branch')) | (l, t', branch') <- threadSteps t branch]
  obey value = case reaction p value of
    Run act -> Reacting p sensors (Following value (thread t act))
    RunToEnd recovery -> recover Nothing (map askSensor sensors) recovery
    Idle -> Reacting p sensors (Idling value)
    Conclude result -> conclude React result sensors []
  -- Unless there will be nothing to sense, the sensors go on.
  switching next branch = Reacting p (alike sensors) (Switching next (known (ask branch)))
   where
    alike = case next of
      Run _ -> id
      Idle -> id
      _ -> map askSensor
  switched next result branch = case (next, result) of
    (Conclude result', Stopped _) -> conclude React result' sensors []
    (Conclude _, _) -> conclude React result sensors [branch]
    (RunToEnd _, Succeeded _) -> conclude React result sensors []
    (RunToEnd recovery, Stopped _) -> recover Nothing sensors recovery
    (RunToEnd recovery, _) -> recover (Just branch) sensors recovery
    (_, Stopped _) -> Reacting p (map asAskedNow sensors) (Choosing Later)
    _ -> conclude React result sensors [branch]
  recover before sensors' recovery = Reacting p sensors' (Recovering before (known (thread t recovery)))
  recovered before result recovery = case (before, result) of
    (Just (Ended wrong), _) -> conclude React wrong sensors (maybe id (:) before [recovery])
    (_, Succeeded _) -> reacting t p sensors Resting
    _ -> conclude React result sensors [recovery]

-- | An operator whose sensors have taken a step.
reacting :: Now -> Program -> [Sensor] -> Phase -> Running
reacting t p sensors phase = case phase of
  Resting
    | any faulted sensors -> conclude React (Failed "a sensor faulted") sensors []
    | all rested sensors -> Reacting p (map restarted sensors) (Choosing Later)
  _ -> Reacting p sensors phase
 where
  restarted = \case
    Polling s -> Polling s {newest = Nothing, request = Unasked, poll = Sleeping (max (clock t) (slot s))}
    other -> other

threadsOf :: Phase -> [Thread]
threadsOf = \case
  Following _ branch -> [branch]
  Switching _ branch -> [branch]
  Recovering before recovery -> maybe id (:) before [recovery]
  _ -> []

-- ** Sensors

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

open :: Now -> Signal -> Sensor
open t = \case
  Watched condition -> Watching condition
  Polled every act ->
    Polling Poller {period = every, sensor = act, slot = clock t, newest = Nothing, request = Unasked, poll = Sleeping (clock t)}

sensorSteps :: Now -> Sensor -> Steps Sensor
sensorSteps t = \case
  Polling poller -> [(l, t', Polling s) | (l, t', s) <- pollerSteps t poller]
  _ -> []

pollerSteps :: Now -> Poller -> Steps Poller
pollerSteps t s =
    case poll s of
      Sleeping until' | clock t >= until' -> silently t (read' s {slot = clock t + period s} True (begin t (sensor s)))
      Reading counts r -> [(l, t', read' s counts r') | (l, t', r') <- steps t r]
      Read counts result ->
        silently t s {newest = if counts then Just result else newest s, poll = Sleeping (nextSlot (slot s) (period s))}
      _ -> []
      ++ [(Happens event, t, s') | request s == Asked, Just (event, s') <- [hears]]
 where
  read' p counts = \case
    Over result
      -- Nobody wants the reading any more; but what went wrong is not lost.
      | request p /= Unasked -> p {poll = Rested (asOutcome result)}
      | otherwise -> p {poll = Read counts result}
    r -> p {poll = Reading counts r}
  hears = case poll s of
    Reading counts r -> fmap (read' heard counts) <$> hear t r
    Rested _ -> Nothing
    _ -> Just (Silent, heard {poll = Rested (Stopped Nothing)})
  heard = s {request = Heard}
  -- Slots that were missed are skipped.
  nextSlot next every
    | next >= clock t = next
    | otherwise = nextSlot (next + every) every

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

-- ** Time

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
  ofThreads threads = concat [moments r | Thread _ r <- threads]
  ofSensors = concat . mapMaybe ofSensor
  ofSensor = \case
    Deadline end -> Just [end]
    Polling Poller {poll = Sleeping until'} -> Just [until']
    Polling Poller {poll = Reading _ r} -> Just (moments r)
    _ -> Nothing
