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
  ( step
  , pass
  ) where

import qualified Data.Map.Strict as Map

import Semantics.Program
import Semantics.State
import Semantics.Verdict

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
data Action
  = Happens Event
  | Forks Program

type Steps a = [(Action, Now, a)]

silently :: Now -> a -> Steps a
silently t a = [(Happens Silent, t, a)]

steps :: Now -> Running -> Steps Running
steps t = \case
  Starting p -> silently t (begin t p)
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
    | Nothing <- verdict Nursery threads = silently t' (Looking Nursery (threads ++ [thread t' "scoped: fork" p]))
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

-- * Being asked to stop

-- | What becomes of it if it hears the request now. Nothing: it cannot.
hear :: Now -> Running -> Maybe (Event, Running)
hear t = \case
  Starting _ -> stopped
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

-- * Branches

threadSteps :: Now -> Thread -> Steps Thread
threadSteps t (Thread label life) = case life of
  Living asked r ->
    [(l, t', settled asked r') | (l, t', r') <- steps t r]
      ++ [(Happens event, t, settled Heard r') | asked == Asked, Just (event, r') <- [hear t r]]
  Finished result -> [ends' result]
  Ended _ -> []
 where
  settled asked = \case
    Over result -> Thread label (Finished (asOutcome result))
    r -> Thread label (Living asked r)
  ends' result = (Happens (IsOver label), t, Thread label (Ended (asOutcome result)))

-- * Reactive operators

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
      ++ case (endOf branch, look t Later sensors) of
        (Just result, _) -> silently t (conclude React result sensors [branch])
        (_, Just (Left wrong)) -> silently t (switching (Conclude wrong) branch)
        (_, Just (Right values))
          | new <- valueOf p values, new /= old -> silently t (switching (reaction p new) branch)
        _ -> []
  Switching next branch -> case endOf branch of
    Just result -> silently t (switched next result branch)
    Nothing -> inThread (Switching next) branch
  Recovering before recovery -> case endOf recovery of
    Just result -> silently t (recovered before result recovery)
    Nothing -> inThread (Recovering before) recovery
  Resting -> []
 where
  inThread inPlace branch = [(l, t', Reacting p sensors (inPlace branch')) | (l, t', branch') <- threadSteps t branch]
  obey value = case reaction p value of
    Run act -> Reacting p sensors (Following value (thread t (nameOf p value) act))
    RunToEnd recovery -> recover Nothing (map askSensor sensors) recovery
    Idle -> Reacting p sensors (Idling value)
    Conclude result -> conclude React result sensors []
  -- Unless there will be nothing to sense, the sensors go on.
  switching next branch = Reacting p (alike sensors) (Switching next (ask branch))
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
  recover before sensors' recovery = Reacting p sensors' (Recovering before (thread t "monitor: recovery" recovery))
  recovered before result recovery = case (before >>= endOf, result) of
    (Just wrong, _) -> conclude React wrong sensors (maybe id (:) before [recovery])
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

-- * Sensors

sensorSteps :: Now -> Sensor -> Steps Sensor
sensorSteps t = \case
  Polling poller -> [(l, t', Polling s) | (l, t', s) <- pollerSteps t poller]
  _ -> []

pollerSteps :: Now -> Poller -> Steps Poller
pollerSteps t s =
    case poll s of
      Sleeping until'
        | clock t >= until' -> silently t (read' s {slot = clock t + period s} True (begin t (sensor s)))
      Reading counts r -> [(l, t', read' s counts r') | (l, t', r') <- steps t r]
      Read counts result ->
        silently t s {newest = if counts then Just result else newest s, poll = Sleeping (nextSlot (slot s))}
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
  nextSlot next
    | next >= clock t = next
    | otherwise = nextSlot (next + period s)
