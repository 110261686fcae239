{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- The steps of the threads that run for a signal: pollers, and the workers of filters.
module Semantics.Sense
  ( -- * Steps
    Effect (..)
  , Steps
  , silently
  , oneOf

    -- * Steps of sources
  , sourceSteps
  ) where

import Data.Maybe (isJust, isNothing)

import Semantics.Begin
import Semantics.Program
import Semantics.Source
import Semantics.State

-- | What a step does outside of its own part of the program.
data Effect
  = Emits Transition
  | -- | Forks a child; its number, if its result is awaited.
    Forks (Maybe Int) Program
  | -- | The fork fails, which is possible only while the nursery is ending.
    Refused

type Steps a = [(Effect, Now, a)]

silently :: Now -> a -> Steps a
silently t a = [(Emits Silent, t, a)]

-- | The steps of one of several concurrent parts.
oneOf :: (a -> Steps a) -> [a] -> Steps [a]
oneOf one = \case
  [] -> []
  a : as -> [(l, t, a' : as) | (l, t, a') <- one a] ++ [(l, t, a : as') | (l, t, as') <- oneOf one as]

-- | The steps of all threads of a source. (The functions are for a reading, which is a
-- program: its steps, and how it receives a stop request.)
sourceSteps
  :: (Now -> Running -> Steps Running)
  -> (Now -> Running -> [(Transition, Running)])
  -> Now
  -> Source
  -> Steps Source
sourceSteps steps receive = go
 where
  go t = \case
    Polling s -> [(l, t', Polling s') | (l, t', s') <- pollerSteps steps receive t s]
    Joined how sources -> [(l, t', Joined how sources') | (l, t', sources') <- oneOf (go t) sources]
    WithHysteresis m source -> inside t (WithHysteresis m) source ++ hysteresisSteps t m source
    Debounced d source -> inside t (Debounced d) source ++ debounceSteps t d source
    Throttled h source -> inside t (Throttled h) source ++ throttleSteps t h source
    WithWatchdog w source ->
      inside t (WithWatchdog w) source
        ++ [(l, t', WithWatchdog w' source) | (l, t', w') <- watchdogSteps t w source]
    Watching _ -> []
    Deadline _ -> []
    SharedSource -> []
  inside t around source = [(l, t', around source') | (l, t', source') <- go t source]

pollerSteps
  :: (Now -> Running -> Steps Running)
  -> (Now -> Running -> [(Transition, Running)])
  -> Now
  -> Poller
  -> Steps Poller
pollerSteps steps receive t s =
    case poll s of
      BetweenSlots due
        | clock t >= due ->
            silently t $
              afterPart
                s {slot = clock t + period s, readings = readings s + 1, inFlightSince = Just (clock t)}
                (begin t (sensor s))
      Reading r -> [(l, t', afterPart s r') | (l, t', r') <- steps t r]
      Unpublished result ->
        silently t $
          s {newest = Just (readings s, result), inFlightSince = Nothing, poll = BetweenSlots (nextSlot (slot s))}
      EndingWith result -> silently t s {poll = PollEnded (asOutcome result)}
      _ -> []
      ++ [(Emits transition, t, s') | pollerRequest s == Requested, (transition, s') <- receives]
 where
  afterPart p = \case
    Over result
      -- The reading is not needed any more, but its failure or fault is kept.
      | pollerRequest p /= NoRequest -> p {poll = EndingWith result}
      | otherwise -> p {poll = Unpublished result}
    r -> p {poll = Reading r}
  receives = case poll s of
    Reading r -> fmap (afterPart afterReceiving) <$> receive t r
    EndingWith _ -> []
    PollEnded _ -> []
    _ -> [(Silent, afterReceiving {poll = PollEnded (Stopped Nothing)})]
  afterReceiving = s {pollerRequest = Received}
  -- Slots that were missed are skipped.
  nextSlot due
    | due >= clock t = due
    | otherwise = nextSlot (due + period s)

-- | The worker of a hysteresis updates the state also with values on which the operator does
-- not act.
hysteresisSteps :: Now -> HysteresisState -> Source -> Steps Source
hysteresisSteps t m source =
  case readSource t FirstRead (view worker) (WithHysteresis m source) of
    Just (Right (high', t', source'))
      | request worker /= Received, high' /= fromEnum (isHigh m) -> silently t' source'
    _ -> []
    ++ [ (Emits Silent, t, WithHysteresis m {hysteresisWorker = worker {request = Received}} source)
       | request worker == Requested
       ]
 where
  worker = hysteresisWorker m

-- | One worker tracks the changes of the value, another measures how long they last.
debounceSteps :: Now -> Debouncer -> Source -> Steps Source
debounceSteps t d source =
  (if request worker == Received then [] else tracks)
    ++ (if timer d == Received then [] else allSilently times)
    ++ allSilently [d {changeWorker = worker {request = Received}} | request worker == Requested]
    ++ allSilently [d {timer = Received} | timer d == Requested]
 where
  worker = changeWorker d
  allSilently ds = [(Emits Silent, t, Debounced d' source) | d' <- ds]
  tracks = case changeTracking d of
    Tracked old -> case readSource t FirstRead (view worker) source of
      Just (Right (value, t', source'))
        | Just value /= old -> silently t' (Debounced d {changeTracking = Observed old value} source')
      _ -> []
    Observed old value ->
      allSilently [(if isNothing old then counts value else waits value) {changeTracking = Tracked (Just value)}]
  counts value = d {settled = Just value}
  waits value = d {pending = if settled d == Just value then Nothing else Just (value, clock t)}
  times = case timedChange d of
    Nothing -> [d {timedChange = pending d} | isJust (pending d)]
    Just (value, since)
      | clock t < since + delay d -> []
      | pending d == timedChange d -> [d {settled = Just value, pending = Nothing, timedChange = Nothing}]
      | otherwise -> [d {timedChange = Nothing}]

-- | The worker takes a value, and then none until the time has passed.
throttleSteps :: Now -> Throttler -> Source -> Steps Source
throttleSteps t h source =
  (if request worker == Received then [] else next)
    ++ [ (Emits Silent, t, Throttled h {throttleWorker = worker {request = Received}} source)
       | request worker == Requested
       ]
 where
  worker = throttleWorker h
  next = case restsUntil h of
    Just due -> [step | clock t >= due, step <- silently t (Throttled h {restsUntil = Nothing} source)]
    Nothing -> case readSource t FirstRead (view worker) source of
      Just (Right (value, t', source'))
        | Just value /= passed h ->
            silently t' (Throttled h {passed = Just value, restsUntil = Just (clock t + gap h)} source')
      _ -> []

-- | The watchdog.
watchdogSteps :: Now -> Watchdog -> Source -> Steps Watchdog
watchdogSteps t w source =
  if watchdogRequest w == Received
    then []
    else watches ++ [(Emits Silent, t, w {watchdogRequest = Received}) | watchdogRequest w == Requested]
 where
  watches = case (watchdogState w, oldestReading t source) of
    (NoReading, Just since) -> silently t w {watchdogState = InFlight since}
    (InFlight since, reading)
      | clock t < since + limit w -> []
      | reading == Just since -> silently t w {overdue = overdue w + 1, watchdogState = Overdue since}
      | otherwise -> silently t w {watchdogState = NoReading}
    (Overdue since, reading)
      | reading /= Just since -> silently t w {overdue = overdue w + overdue w `mod` 2, watchdogState = NoReading}
    _ -> []
