{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- The sources of signals: how they are opened, read and stopped.
module Semantics.Source
  ( -- * Opening
    open
  , unstarted
  , startSource
  , viewOf

    -- * Reading
  , readSource
  , oldestReading

    -- * Stopping
  , requestStopOfSource
  , allStopped
  , deadPollers
  , pollerFaults
  , remaining
  , noSource
  ) where

import Data.List (findIndex)
import qualified Data.Map.Strict as Map
import Data.Maybe (fromMaybe, mapMaybe)

import Semantics.Program
import Semantics.State

-- * Opening

-- | Opens a signal, and starts the threads that it needs.
open :: Now -> Signal -> Source
open t = startSource t . unstarted

-- | A source whose threads have not been started.
unstarted :: Signal -> Source
unstarted = \case
  Watched condition -> Watching condition
  Polled every act ->
    Polling
      Poller
        { period = every
        , sensor = act
        , slot = 0
        , readings = 0
        , newest = Nothing
        , inFlightSince = Nothing
        , pollerRequest = Received
        , poll = PollEnded (Stopped Nothing)
        }
  And a b -> Joined AllHold [unstarted a, unstarted b]
  Hysteresis initially l h s ->
    WithHysteresis HysteresisState {low = l, high = h, isHigh = initially, hysteresisWorker = resting} (unstarted s)
  Debounce n s ->
    Debounced
      Debouncer
        { delay = n
        , settled = Nothing
        , pending = Nothing
        , changeWorker = resting
        , changeTracking = Tracked Nothing
        , timer = Received
        , timedChange = Nothing
        }
      (unstarted s)
  Throttle n s ->
    Throttled Throttler {gap = n, passed = Nothing, throttleWorker = resting, restsUntil = Nothing} (unstarted s)
  StaleAfter n s ->
    WithWatchdog Watchdog {limit = n, overdue = 0, watchdogRequest = Received, watchdogState = NoReading} (unstarted s)
  Shared -> SharedSource
 where
  resting = Worker {request = Received, view = Always}

-- | Starts the threads of a source, for the first time or again. When restarted, a hysteresis
-- keeps whether it was high, and a poller keeps the time at which its next reading is due.
startSource :: Now -> Source -> Source
startSource t = \case
  Polling s ->
    Polling
      s
        { newest = Nothing
        , inFlightSince = Nothing
        , pollerRequest = NoRequest
        , poll = BetweenSlots (max (clock t) (slot s))
        }
  Joined how sources -> Joined how (map (startSource t) sources)
  WithHysteresis m source -> WithHysteresis m {hysteresisWorker = workerFor inner} inner
   where
    inner = startSource t source
  Debounced d source -> Debounced fresh inner
   where
    inner = startSource t source
    fresh =
      d
        { settled = Nothing
        , pending = Nothing
        , changeWorker = workerFor inner
        , changeTracking = Tracked Nothing
        , timer = NoRequest
        , timedChange = Nothing
        }
  Throttled h source -> Throttled h {passed = Nothing, throttleWorker = workerFor inner, restsUntil = Nothing} inner
   where
    inner = startSource t source
  WithWatchdog w source ->
    WithWatchdog (notOverdue w) {watchdogRequest = NoRequest, watchdogState = NoReading} (startSource t source)
  Watching condition -> Watching condition
  Deadline end -> Deadline end
  SharedSource -> SharedSource
 where
  workerFor inner = Worker {request = NoRequest, view = viewOf t inner}
  notOverdue w = w {overdue = overdue w + overdue w `mod` 2}

-- | A view that accepts only readings that start from now on.
viewOf :: Now -> Source -> View
viewOf t = \case
  Polling s -> After (readings s) Always
  Joined _ sources -> Each (map (viewOf t) sources)
  WithHysteresis _ source -> viewOf t source
  Debounced _ source -> viewOf t source
  Throttled _ source -> viewOf t source
  WithWatchdog w source -> After (overdue w) (viewOf t source)
  SharedSource -> case shared t of
    s : outer -> viewOf t {shared = outer} s
    [] -> Always
  Watching _ -> Always
  Deadline _ -> Always

-- * Reading

-- | Reads a source, from left to right. Gives the value, and the source after the reading: if
-- the reader acts on the value, a hysteresis keeps the new state. 'Nothing': there is no
-- value yet.
readSource :: Now -> ReadMode -> View -> Source -> Maybe (Either Result (Int, Now, Source))
readSource t mode v source = case source of
  Watching condition -> case (Map.lookup condition (levels t), mode) of
    (Just (At n), _) -> gives n
    (Just ThrowsFailure, _) -> wrong (FailedWith condition)
    (Just ThrowsFault, _) -> wrong (FaultedWith condition)
    (_, FirstRead) -> Nothing
    (_, Reread) -> wrong (FailedWith noValue)
  Deadline end -> gives (fromEnum (clock t >= end))
  Polling s
    | After n _ <- v, Just (k, result) <- newest s, k > n -> case result of
        Succeeded value -> gives (number value)
        other -> wrong other
    | otherwise -> Nothing
  Joined how sources
    | Each views <- v -> joined how [] t (zip views sources)
    | otherwise -> Nothing
  WithHysteresis m inner -> inside v inner $ \n t' inner' ->
    let after = n >= high m || (isHigh m && n > low m)
     in found (fromEnum after) t' (WithHysteresis m {isHigh = after} inner')
  Debounced d inner -> inside v inner $ \_ t' inner' ->
    settled d >>= \n -> found n t' (Debounced d inner')
  Throttled h inner -> inside v inner $ \_ t' inner' ->
    passed h >>= \n -> found n t' (Throttled h inner')
  WithWatchdog w inner
    | After n _ <- v, odd (overdue w) || overdue w > n -> wrong (FailedWith (overdueBy (limit w)))
    | After _ v' <- v -> inside v' inner $ \m t' inner' -> found m t' (WithWatchdog w inner')
    | otherwise -> Nothing
  -- If a poller of the shared source has died, the reading fails, whatever the value is.
  SharedSource
    | s : outer <- shared t -> case deadPollers s of
        dead : _ -> wrong dead
        [] -> readInner t {shared = outer} v s $ \n t' s' -> found n t' {shared = s' : shared t'} SharedSource
    | otherwise -> Nothing
 where
  gives n = found n t source
  found n t' source' = Just (Right (n, t', source'))
  wrong = Just . Left
  inside = readInner t
  readInner t' v' s next =
    readSource t' mode v' s >>= \case
      Left why -> wrong why
      Right (n, t'', s') -> next n t'' s'
  joined how done t' = \case
    [] -> found (join how (map fst values)) t' (Joined how (map snd values))
     where
      values = reverse done
    (v', s) : others -> readInner t' v' s $ \n t'' s' -> joined how ((n, s') : done) t'' others
  join = \case
    AllHold -> fromEnum . all holds
    FirstHolding -> fromMaybe (-1) . findIndex holds

-- | When the oldest of the readings in flight began.
oldestReading :: Now -> Source -> Maybe Ticks
oldestReading t = \case
  Polling s -> inFlightSince s
  SharedSource | s : outer <- shared t -> oldestReading t {shared = outer} s
  source -> case mapMaybe (oldestReading t) (madeOf source) of
    [] -> Nothing
    since -> Just (minimum since)

-- | The sources that it is made of, from left to right.
madeOf :: Source -> [Source]
madeOf = \case
  Joined _ sources -> sources
  WithHysteresis _ source -> [source]
  Debounced _ source -> [source]
  Throttled _ source -> [source]
  WithWatchdog _ source -> [source]
  Polling _ -> []
  Watching _ -> []
  Deadline _ -> []
  SharedSource -> []

-- * Stopping

-- | Requests the stop of all threads of a source.
requestStopOfSource :: Source -> Source
requestStopOfSource = \case
  Polling s -> Polling s {pollerRequest = withStop (pollerRequest s)}
  Joined how sources -> Joined how (map requestStopOfSource sources)
  WithHysteresis m source ->
    WithHysteresis m {hysteresisWorker = requestStopOfWorker (hysteresisWorker m)} (requestStopOfSource source)
  Debounced d source ->
    Debounced
      d {changeWorker = requestStopOfWorker (changeWorker d), timer = withStop (timer d)}
      (requestStopOfSource source)
  Throttled h source ->
    Throttled h {throttleWorker = requestStopOfWorker (throttleWorker h)} (requestStopOfSource source)
  WithWatchdog w source ->
    WithWatchdog w {watchdogRequest = withStop (watchdogRequest w)} (requestStopOfSource source)
  Watching condition -> Watching condition
  Deadline end -> Deadline end
  SharedSource -> SharedSource
 where
  requestStopOfWorker w = w {request = withStop (request w)}
  withStop = \case
    NoRequest -> Requested
    other -> other

-- | Whether all threads of a source have ended.
allStopped :: Source -> Bool
allStopped = \case
  Polling Poller {poll = PollEnded _} -> True
  Polling _ -> False
  Joined _ sources -> all allStopped sources
  WithHysteresis m source -> request (hysteresisWorker m) == Received && allStopped source
  Debounced d source -> request (changeWorker d) == Received && timer d == Received && allStopped source
  Throttled h source -> request (throttleWorker h) == Received && allStopped source
  WithWatchdog w source -> watchdogRequest w == Received && allStopped source
  Watching _ -> True
  Deadline _ -> True
  SharedSource -> True

-- | How the pollers of a source have ended, from left to right.
pollerEnds :: Source -> [Result]
pollerEnds = \case
  Polling Poller {poll = PollEnded result} -> [result]
  source -> concatMap pollerEnds (madeOf source)

-- | The failures and faults with which pollers of a source have ended.
deadPollers :: Source -> [Result]
deadPollers = filter isDead . pollerEnds
 where
  isDead = \case
    FailedWith _ -> True
    FaultedWith _ -> True
    _ -> False

pollerFaults :: Source -> [String]
pollerFaults source = [fault | FaultedWith fault <- pollerEnds source]

-- | The part of a source that must still be awaited after its stop was requested, when it is
-- not read any more: its pollers. (The threads of filters stop at once.)
remaining :: Source -> Source
remaining = Joined AllHold . pollers
 where
  pollers = \case
    s@(Polling Poller {poll = PollEnded (FaultedWith _)}) -> [s]
    Polling Poller {poll = PollEnded _} -> []
    s@(Polling _) -> [s]
    source -> concatMap pollers (madeOf source)

noSource :: Source
noSource = Joined AllHold []
