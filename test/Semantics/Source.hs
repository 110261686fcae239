{-# LANGUAGE LambdaCase #-}

-- |
-- What signals are made of: how they are opened, and what is seen in them.
module Semantics.Source
  ( -- * Opening
    signals
  , borrows
  , open
  , made
  , startedAt
  , viewOf

    -- * Looking
  , look
  , readingOf

    -- * Being asked to stop
  , askSource
  , rested
  , lostOf
  , faultsOf
  , remaining
  , nothing
  ) where

import Data.List (findIndex)
import qualified Data.Map.Strict as Map
import Data.Maybe (fromMaybe, mapMaybe)

import Semantics.Program
import Semantics.State

-- * Opening

-- | The signals of an operator.
signals :: Program -> [Signal]
signals = \case
  RSelect s _ _ -> [s]
  Monitor s _ _ -> [s]
  Switch s _ -> [s]
  TeleoReactive rules -> map fst rules
  WaitUntil s -> [s]
  WhileHolding s _ -> [s]
  WithShared s _ -> [s]
  _ -> []

-- | Whether a signal is made of a shared one.
borrows :: Signal -> Bool
borrows = \case
  Shared -> True
  Watched _ -> False
  Polled _ _ -> False
  And a b -> borrows a || borrows b
  Hysteresis _ _ _ s -> borrows s
  Debounce _ s -> borrows s
  StaleAfter _ s -> borrows s

-- | Opens a signal, and starts what must run for it.
open :: Now -> Signal -> Source
open t = startedAt t . made

-- | A source for which nothing runs yet.
made :: Signal -> Source
made = \case
  Watched condition -> Watching condition
  Polled every act ->
    Polling
      Poller
        { period = every
        , sensor = act
        , slot = 0
        , readings = 0
        , newest = Nothing
        , underWay = Nothing
        , asked = Heard
        , poll = Rested (Stopped Nothing)
        }
  And a b -> Joined AllHold [made a, made b]
  Hysteresis initially l h s -> Remembering Memory {low = l, high = h, isHigh = initially, reminder = resting} (made s)
  Debounce n s ->
    Settling
      Debouncer
        { delay = n
        , settled = Nothing
        , pending = Nothing
        , noticer = resting
        , noticing = Noted Nothing
        , timer = Heard
        , timing = Nothing
        }
      (made s)
  StaleAfter n s -> Guarding Watchdog {limit = n, overdue = 0, guard = Heard, guarding = Free} (made s)
  Shared -> Borrowed
 where
  resting = Worker {request = Heard, view = Always}

-- | Starts what must run for a source, anew perhaps. Of what went before, a hysteresis
-- remembers whether it was high, and a poller when the next reading is due.
startedAt :: Now -> Source -> Source
startedAt t = \case
  Polling s ->
    Polling s {newest = Nothing, underWay = Nothing, asked = Unasked, poll = Sleeping (max (clock t) (slot s))}
  Joined how sources -> Joined how (map (startedAt t) sources)
  Remembering m source -> Remembering m {reminder = looksAt inner} inner
   where
    inner = startedAt t source
  Settling d source -> Settling fresh inner
   where
    inner = startedAt t source
    fresh =
      d
        { settled = Nothing
        , pending = Nothing
        , noticer = looksAt inner
        , noticing = Noted Nothing
        , timer = Unasked
        , timing = Nothing
        }
  Guarding w source -> Guarding (calmed w) {guard = Unasked, guarding = Free} (startedAt t source)
  other -> other
 where
  looksAt inner = Worker {request = Unasked, view = viewOf t inner}
  calmed w = w {overdue = overdue w + overdue w `mod` 2}

-- | A view of the values that are read from now on.
viewOf :: Now -> Source -> View
viewOf t = \case
  Polling s -> After (readings s) Always
  Joined _ sources -> Each (map (viewOf t) sources)
  Remembering _ source -> viewOf t source
  Settling _ source -> viewOf t source
  Guarding w source -> After (overdue w) (viewOf t source)
  Borrowed | s : outer <- shared t -> viewOf t {shared = outer} s
  _ -> Always

-- * Looking

-- | A look at a source, from left to right, and what becomes of the source by it: if who
-- looks acts on it, then a hysteresis remembers what was seen. Nothing: there is no value
-- yet.
look :: Now -> Moment -> View -> Source -> Maybe (Either Result (Int, Now, Source))
look t moment v source = case (source, v) of
  (Watching condition, _) -> case (Map.lookup condition (levels t), moment) of
    (Just (At n), _) -> sees n
    (Just Failing, _) -> wrong (Failed condition)
    (Just Faulting, _) -> wrong (Faulted condition)
    (_, First) -> Nothing
    (_, Later) -> wrong (Failed noValue)
  (Deadline end, _) -> sees (fromEnum (clock t >= end))
  (Polling s, After n _) -> case newest s of
    Just (k, result) | k > n -> case result of
      Succeeded value -> sees (number value)
      other -> wrong other
    _ -> Nothing
  (Joined how sources, Each views) -> joined how [] t (zip views sources)
  (Remembering m inner, _) -> inside v inner $ \n t' inner' ->
    let after = n >= high m || (isHigh m && n > low m)
     in found (fromEnum after) t' (Remembering m {isHigh = after} inner')
  (Settling d inner, _) -> inside v inner $ \_ t' inner' ->
    settled d >>= \n -> found n t' (Settling d inner')
  (Guarding w inner, After n v')
    | odd (overdue w) || overdue w > n -> wrong (Failed (overdueBy (limit w)))
    | otherwise -> inside v' inner $ \m t' inner' -> found m t' (Guarding w inner')
  -- What it is made of may have died: then it fails, whatever its value.
  (Borrowed, _) | s : outer <- shared t -> case lostOf s of
    dead : _ -> wrong dead
    [] -> seeing t {shared = outer} v s $ \n t' s' -> found n t' {shared = s' : shared t'} Borrowed
  _ -> Nothing
 where
  sees n = found n t source
  found n t' source' = Just (Right (n, t', source'))
  wrong = Just . Left
  inside = seeing t
  seeing t' v' s next =
    look t' moment v' s >>= \case
      Left why -> wrong why
      Right (n, t'', s') -> next n t'' s'
  joined how done t' = \case
    [] -> found (join how (map fst values)) t' (Joined how (map snd values))
     where
      values = reverse done
    (v', s) : others -> seeing t' v' s $ \n t'' s' -> joined how ((n, s') : done) t'' others
  join = \case
    AllHold -> fromEnum . all holds
    FirstHolding -> fromMaybe (-1) . findIndex holds

-- | When the oldest reading began that is under way.
readingOf :: Now -> Source -> Maybe Ticks
readingOf t = \case
  Polling s -> underWay s
  Joined _ sources -> case mapMaybe (readingOf t) sources of
    [] -> Nothing
    since -> Just (minimum since)
  Remembering _ source -> readingOf t source
  Settling _ source -> readingOf t source
  Guarding _ source -> readingOf t source
  Borrowed | s : outer <- shared t -> readingOf t {shared = outer} s
  _ -> Nothing

-- * Being asked to stop

-- | Asks all that runs for a source.
askSource :: Source -> Source
askSource = \case
  Polling s -> Polling s {asked = ask' (asked s)}
  Joined how sources -> Joined how (map askSource sources)
  Remembering m source -> Remembering m {reminder = askWorker (reminder m)} (askSource source)
  Settling d source -> Settling d {noticer = askWorker (noticer d), timer = ask' (timer d)} (askSource source)
  Guarding w source -> Guarding w {guard = ask' (guard w)} (askSource source)
  other -> other
 where
  askWorker w = w {request = ask' (request w)}
  ask' = \case
    Unasked -> Asked
    other -> other

-- | Whether all that ran for a source has ended.
rested :: Source -> Bool
rested = \case
  Polling Poller {poll = Rested _} -> True
  Polling _ -> False
  Joined _ sources -> all rested sources
  Remembering m source -> request (reminder m) == Heard && rested source
  Settling d source -> request (noticer d) == Heard && timer d == Heard && rested source
  Guarding w source -> guard w == Heard && rested source
  _ -> True

-- | How the pollers of a source have ended, from left to right.
endsOf :: Source -> [Result]
endsOf = \case
  Polling Poller {poll = Rested result} -> [result]
  Joined _ sources -> concatMap endsOf sources
  Remembering _ source -> endsOf source
  Settling _ source -> endsOf source
  Guarding _ source -> endsOf source
  _ -> []

-- | What they died of.
lostOf :: Source -> [Result]
lostOf = filter isLost . endsOf
 where
  isLost = \case
    Failed _ -> True
    Faulted _ -> True
    _ -> False

faultsOf :: Source -> [String]
faultsOf source = [fault | Faulted fault <- endsOf source]

-- | What there is to wait for in a source that was asked to stop, and at which nobody
-- looks any more. (What looks at others stops at once.)
remaining :: Source -> Source
remaining = Joined AllHold . pollers
 where
  pollers = \case
    s@(Polling Poller {poll = Rested (Faulted _)}) -> [s]
    Polling Poller {poll = Rested _} -> []
    s@(Polling _) -> [s]
    Joined _ sources -> concatMap pollers sources
    Remembering _ source -> pollers source
    Settling _ source -> pollers source
    Guarding _ source -> pollers source
    _ -> []

nothing :: Source
nothing = Joined AllHold []
