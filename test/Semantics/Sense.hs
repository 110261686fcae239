{-# LANGUAGE LambdaCase #-}

-- |
-- What runs for a signal: pollers that read, and those that look at what they read.
module Semantics.Sense
  ( -- * Steps
    Action (..)
  , Steps
  , silently
  , oneOf

    -- * Of what runs for a signal
  , sourceSteps
  ) where

import Data.Maybe (isJust, isNothing)

import Semantics.Begin
import Semantics.Program
import Semantics.Source
import Semantics.State

-- | A step of a part of the program may also be one that is its surroundings' business.
data Action
  = Happens Transition
  | -- | Perhaps an answer is wanted, by that number.
    Forks (Maybe Int) Program
  | -- | It fails to fork, which is so only while its nursery is ending.
    Refused

type Steps a = [(Action, Now, a)]

silently :: Now -> a -> Steps a
silently t a = [(Happens Silent, t, a)]

-- | What may happen in one of several that run side by side.
oneOf :: (a -> Steps a) -> [a] -> Steps [a]
oneOf one = \case
  [] -> []
  a : as -> [(l, t, a' : as) | (l, t, a') <- one a] ++ [(l, t, a : as') | (l, t, as') <- oneOf one as]

-- | The steps of all that runs for a source. (It is said how a reading, which is a program,
-- takes its steps, and how it hears a request to stop.)
sourceSteps
  :: (Now -> Running -> Steps Running)
  -> (Now -> Running -> [(Transition, Running)])
  -> Now
  -> Source
  -> Steps Source
sourceSteps steps hear = go
 where
  go t = \case
    Polling s -> [(l, t', Polling s') | (l, t', s') <- pollerSteps steps hear t s]
    Joined how sources -> [(l, t', Joined how sources') | (l, t', sources') <- oneOf (go t) sources]
    Remembering m source -> inside t (Remembering m) source ++ reminds t m source
    Settling d source -> inside t (Settling d) source ++ settles t d source
    Guarding w source -> inside t (Guarding w) source ++ [(l, t', Guarding w' source) | (l, t', w') <- guards t w source]
    _ -> []
  inside t around source = [(l, t', around source') | (l, t', source') <- go t source]

pollerSteps
  :: (Now -> Running -> Steps Running)
  -> (Now -> Running -> [(Transition, Running)])
  -> Now
  -> Poller
  -> Steps Poller
pollerSteps steps hear t s =
    case poll s of
      Sleeping until'
        | clock t >= until' ->
            silently t $
              read'
                s {slot = clock t + period s, readings = readings s + 1, underWay = Just (clock t)}
                (begin t (sensor s))
      Reading r -> [(l, t', read' s r') | (l, t', r') <- steps t r]
      Read result ->
        silently t s {newest = Just (readings s, result), underWay = Nothing, poll = Sleeping (nextSlot (slot s))}
      Leaving result -> silently t s {poll = Rested (asOutcome result)}
      _ -> []
      ++ [(Happens event, t, s') | asked s == Asked, (event, s') <- hears]
 where
  read' p = \case
    Over result
      -- Nobody wants the reading any more; but what went wrong is not lost.
      | asked p /= Unasked -> p {poll = Leaving result}
      | otherwise -> p {poll = Read result}
    r -> p {poll = Reading r}
  hears = case poll s of
    Reading r -> fmap (read' heard) <$> hear t r
    Leaving _ -> []
    Rested _ -> []
    _ -> [(Silent, heard {poll = Rested (Stopped Nothing)})]
  heard = s {asked = Heard}
  -- Slots that were missed are skipped.
  nextSlot due
    | due >= clock t = due
    | otherwise = nextSlot (due + period s)

-- | A hysteresis remembers also what its operator does not act on.
reminds :: Now -> Memory -> Source -> Steps Source
reminds t m source =
  case look t First (view worker) (Remembering m source) of
    Just (Right (high', t', source'))
      | request worker /= Heard, high' /= fromEnum (isHigh m) -> silently t' source'
    _ -> []
    ++ [(Happens Silent, t, Remembering m {reminder = worker {request = Heard}} source) | request worker == Asked]
 where
  worker = reminder m

-- | One notices when the value changes, another counts how long it lasts.
settles :: Now -> Debouncer -> Source -> Steps Source
settles t d source =
  (if request worker == Heard then [] else notices)
    ++ (if timer d == Heard then [] else silently' times)
    ++ silently' [d {noticer = worker {request = Heard}} | request worker == Asked]
    ++ silently' [d {timer = Heard} | timer d == Asked]
 where
  worker = noticer d
  silently' ds = [(Happens Silent, t, Settling d' source) | d' <- ds]
  notices = case noticing d of
    Noted old -> case look t First (view worker) source of
      Just (Right (value, t', source'))
        | Just value /= old -> silently t' (Settling d {noticing = Noticed old value} source')
      _ -> []
    Noticed old value -> silently' [(if isNothing old then counts value else waits value) {noticing = Noted (Just value)}]
  counts value = d {settled = Just value}
  waits value = d {pending = if settled d == Just value then Nothing else Just (value, clock t)}
  times = case timing d of
    Nothing -> [d {timing = pending d} | isJust (pending d)]
    Just (value, since)
      | clock t < since + delay d -> []
      | pending d == timing d -> [d {settled = Just value, pending = Nothing, timing = Nothing}]
      | otherwise -> [d {timing = Nothing}]

-- | The watchdog.
guards :: Now -> Watchdog -> Source -> Steps Watchdog
guards t w source = if guard w == Heard then [] else watches ++ [(Happens Silent, t, w {guard = Heard}) | guard w == Asked]
 where
  watches = case (guarding w, readingOf t source) of
    (Free, Just since) -> silently t w {guarding = Due since}
    (Due since, reading)
      | clock t < since + limit w -> []
      | reading == Just since -> silently t w {overdue = overdue w + 1, guarding = Late since}
      | otherwise -> silently t w {guarding = Free}
    (Late since, reading)
      | reading /= Just since -> silently t w {overdue = overdue w + overdue w `mod` 2, guarding = Free}
    _ -> []
