{-# LANGUAGE LambdaCase #-}

-- |
-- A program of the specification, as a behaviour on the library's own operators.
module Semantics.Run
  ( observed
  , allObserved
  ) where

import Control.Concurrent.STM (STM, TVar, newTVarIO, readTVar, retry, throwSTM, writeTVar)
import Control.Exception
  ( ErrorCall (..)
  , Exception (..)
  , SomeException
  , asyncExceptionFromException
  , asyncExceptionToException
  , evaluate
  , mask
  , mask_
  , onException
  , throwIO
  , try
  , uninterruptibleMask_
  )
import Control.Monad (void)
import Data.Foldable (for_)
import Data.IORef
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust)
import Data.Set (Set)
import qualified Data.Set as Set

import Behavior.Internal.Failure hiding (Failed (..))
import Behavior.Internal.Nursery
import Behavior.Internal.Parallel (allOf, both, firstOf, parallel)
import Behavior.Internal.Reactive.Operators
import Behavior.Internal.Reactive.Timeout
import Behavior.Internal.Runtime hiding (Event (..), Label)
import Behavior.Internal.Signal.Filter
import Behavior.Internal.Signal.Polling
import Behavior.Internal.Signal.Shared (withShared)
import Behavior.Internal.Signal.Source (watching)
import qualified Behavior.Internal.Signal.Source as Library
import Behavior.Sim
  ( StepKind (Note)
  , Label (..)
  , Options (endAt, scheduled, slip, livelockLimit)
  , Plan (..)
  , Report (complete)
  , Run (finished, outcome)
  , Schedule
  , Search (Exhaustive)
  , Step (at, did, label)
  , defaults
  , exhaustively
  , explore
  , simulateWith
  )
import qualified Behavior.Sim as Sim
import Semantics.Path (End (..), Seen (..))
import Semantics.Program hiding (Label)

-- | Simulates the world's program under a schedule, and gives what could be seen; or
-- says why there was no end to see.
observed :: Schedule -> World -> IO (Either String Seen)
observed how world = observing (simulateWith (limits world) {scheduled = how}) world

-- | Simulates the world's program under all schedules with up to so many pre-emptions,
-- but under no more schedules than the second number, and gives all that could be seen
-- and whether those were all the schedules.
allObserved :: Int -> Int -> World -> IO (Set (Either String Seen), Bool)
allObserved preemptions most world = do
  found <- newIORef Set.empty
  report <- explore (exhaustively preemptions) {search = Exhaustive preemptions most, runOptions = limits world} $ \simulated ->
    observing simulated world >>= \seen -> modifyIORef' found (Set.insert seen)
  found' <- readIORef found
  pure (found', complete report)

-- | A run without an end is cut short.
limits :: World -> Options
limits world = defaults {livelockLimit = 20000, endAt = 60, slip = fromIntegral (slippage world)}

observing :: (Behavior Value -> IO (Run Value)) -> World -> IO (Either String Seen)
observing simulated world = do
  happened <- newIORef []
  -- In the record of the run is when it happened.
  let tell event = modifyIORef' happened (event :) >> annotate (show event)
  run <- simulated (behavior tell world)
  told <- reverse <$> readIORef happened
  let record = recorded (Sim.steps run) told
      seen e = Right Seen {timeline = record, end = e}
      gave = seen . Gave (ticks (finished run))
  inFull $ case outcome run of
    Sim.Returned value -> gave (Succeeded value)
    Sim.Failing e -> gave (thrown e)
    Sim.Faulting e -> gave (thrown e)
    Sim.Cancelled e -> gave (thrown e)
    Sim.OutOfTime -> seen (Unknown (ticks (finished run)))
    Sim.Deadlock _ -> Left "a deadlock, though there is an end to wait for"
    Sim.Livelock labels -> Left ("livelock: " ++ show labels)
    Sim.BlockedOutside who _ -> Left ("outside: " ++ show who)
    Sim.ExternalWakeup waiting -> Left ("meddled: " ++ show waiting)
    Sim.TooSlow who _ -> Left ("too slow: " ++ show who)
    Sim.ScheduleMismatch why -> Left ("misfit: " ++ why)
 where
  -- (Otherwise it would keep the whole run.)
  inFull whole = whole <$ evaluate (whole == whole)
  ticks = round
  recorded (s : others) events = case (did s, events) of
    (Note _, event : later) -> (ticks (at s), event) : recorded others later
    -- The relation speaks of branches only.
    (Sim.Ends, _) | isBranch (label s) -> (ticks (at s), IsOver (show (label s))) : recorded others events
    _ -> recorded others events
  recorded [] _ = []
  isBranch (Label _ name) = name `notElem` ["", "polling", "clock", "staleAfter", "debounce", "debounce clock", "hysteresis"]

-- | Where a program acts: what the conditions are at, how often actions were called,
-- where to fork, and what is shared.
data Stage = Stage
  { levels :: Map Condition (TVar Level)
  , calls :: IORef (Map Name Int)
  , forking :: Behavior Value -> Behavior (Child Value)
  , nearest :: Library.Signal Int
  }

-- | The world's program and environment. What can be seen is told to the given
-- action, which must not be a scheduling point.
behavior :: (Transition -> IO ()) -> World -> Behavior Value
behavior tell world = do
  stage <- Stage <$> traverse newTVarIO (Map.fromList (conditions world)) <*> newIORef Map.empty <*> pure noNursery <*> pure (pure 0)
  let played = play tell stage (program world)
  case caller world of
    Operator -> firstOf [played, timeIsUp <$ environment stage]
    Stranger type' later -> do
      thread <- mask_ (start (Sim.Label "stranger" "") played)
      let interrupting = case type' of
            Asynchronous -> throwToAll (const Enough) [threadId thread]
            Synchronous -> throwToAll (const EnoughOfThis) [threadId thread]
      environment stage
      interrupting
      sleepUntil (fromIntegral (patience world + later))
      interrupting
      atomically (threadEnd thread) >>= either throwIO pure
 where
  environment stage = do
    for_ (changes world) $ \(Change when condition level) -> do
      sleepUntil (fromIntegral when)
      for_ (Map.lookup condition (levels stage)) $ \var -> atomically (writeTVar var level)
      tell (condition `Becomes` level)
    sleepUntil (fromIntegral (patience world))
  noNursery _ = throwIO (ErrorCall "a fork outside every scope")

play :: (Transition -> IO ()) -> Stage -> Program -> Behavior Value
play tell stage = go
 where
  go :: Program -> Behavior Value
  go = \case
    Do name scripts -> do
      checkpoint
      n <- atomicModifyIORef' (calls stage) $ \counts ->
        let n = Map.findWithDefault 0 name counts in (Map.insert name (n + 1) counts, n)
      act (\deed -> tell (name `Does` deed)) name (scripts !! min n (length scripts - 1))
    Pure value -> pure value
    Then first second -> go first >> go second
    Else first second -> go first ? go second
    Attempt n p -> attempt n (go p)
    FallbackOver ps -> fallbackOver ps go
    Parallel left right -> Unit <$ parallel (go left) (go right)
    Both left right -> Unit <$ both (go left) (go right)
    FirstOf ps -> firstOf (map go ps)
    AllOf ps -> Several <$> allOf (map go ps)
    RSelect signal left right -> rSelect (holds <$> level signal) (go left) (go right)
    Monitor signal recovery task -> monitor (holds <$> level signal) (void (go recovery)) (go task)
    Switch signal branches -> switch (level signal) (\n -> go (branches !! max 0 (min n (length branches - 1))))
    TeleoReactive rules -> teleoReactive [(holds <$> level signal, go p) | (signal, p) <- rules]
    WaitUntil signal -> Unit <$ waitUntil (holds <$> level signal)
    WhileHolding signal p -> whileHolding (holds <$> level signal) (go p)
    Timeout limit p -> timeout (fromIntegral limit) (go p)
    WithShared signal p -> withShared (level signal) (\s -> play tell stage {nearest = s} p)
    Scoped body -> scoped (\nursery -> play tell stage {forking = fork nursery} body)
    Fork p -> Unit <$ forking stage (go p)
    Await p q -> forking stage (go p) >>= \child -> go q >> atomically (await child)
    Retract p q -> forking stage (go p) >>= \child -> go q >> requestStop child >> atomically (await child)
  level = \case
    Watched condition -> watching (reading condition)
    Polled every p -> number <$> polling (fromIntegral every) (go p)
    And a b -> (\m n -> fromEnum (holds m && holds n)) <$> level a <*> level b
    Hysteresis initially low high signal -> fromEnum <$> hysteresis initially low high (level signal)
    Debounce n signal -> debounce (fromIntegral n) (level signal)
    StaleAfter n signal -> staleAfter (fromIntegral n) (level signal)
    Shared -> nearest stage
  reading :: Condition -> STM Int
  reading condition = case Map.lookup condition (levels stage) of
    Nothing -> retry
    Just var ->
      readTVar var >>= \case
        At n -> pure n
        Lost -> retry
        Failing -> throwSTM (Failure condition)
        Faulting -> throwSTM (Fault condition)

-- | One call of an action.
act :: (Deed -> IO ()) -> Name -> Script -> Behavior Value
act tell name script = do
  tell Begins
  mask $ \restore ->
    try (inState restore (wait (takes script))) >>= \case
      Right () -> finish name (ends script)
      Left e
        | not (isStopRequest e) -> throwIO e
        | otherwise -> do
            tell Hears
            case whenAsked script of
              StopsAtOnce -> throwIO e
              StopsAfter n -> clean n >> tell Stops >> throwIO e
              TidiesUp n -> (wait n `onException` tell Hears) >> tell Stops >> throwIO e
              EndsAfter n how -> clean n >> finish (cleanupOf name) how
 where
  inState restore = case masking script of
    Unmasked -> restore
    Masked -> id
    Uninterruptible -> uninterruptibleMask_
  finish :: Name -> Ending -> IO Value
  finish who how = do
    tell (Ends how)
    case how of
      Succeeds n -> pure (Number n)
      Fails -> throwIO (Failure who)
      Faults -> throwIO (Fault who)
  clean n = uninterruptibleMask_ (wait n)
  -- Also what takes no time can be interrupted by others, or be overtaken by them.
  wait n = if n > 0 then sleep (fromIntegral n) else checkpoint

-- | An exception that the run ended with, as a result.
thrown :: SomeException -> Result
thrown e
  | Just (StoppedWithFault _ fault) <- fromException e = Stopped (Just (show fault))
  | isStopRequest e = Stopped Nothing
  | isFailure e = Failed (show e)
  | otherwise = Faulted (show e)

newtype Failure = Failure Name

instance Show Failure where
  show (Failure name) = name

instance Exception Failure where
  toException = behaviorFailedToException
  fromException = behaviorFailedFromException

-- | Whether it stops what runs; what a stranger throws does, whatever its type.
isStopRequest :: SomeException -> Bool
isStopRequest e = isCancellation e || isJust (fromException e :: Maybe EnoughOfThis)

-- | What a stranger throws, of an asynchronous type and of a synchronous one.
data Enough = Enough
  deriving (Show)

data EnoughOfThis = EnoughOfThis
  deriving (Show)

instance Exception EnoughOfThis

instance Exception Enough where
  toException = asyncExceptionToException
  fromException = asyncExceptionFromException

newtype Fault = Fault Name

instance Show Fault where
  show (Fault name) = name

instance Exception Fault
