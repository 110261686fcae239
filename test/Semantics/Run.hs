{-# LANGUAGE LambdaCase #-}

-- |
-- Runs a program of the specification with the library's operators, in the simulator.
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
import Data.Maybe (catMaybes, isJust, isNothing)
import Data.Set (Set)
import qualified Data.Set as Set

import Behavior.Internal.Failure hiding (Failed (..))
import Behavior.Internal.Nursery
import Behavior.Internal.Parallel (allOf, both, decide, firstOf, parallel)
import Behavior.Internal.Reactive.Operators
import Behavior.Internal.Reactive.Timeout
import Behavior.Internal.Runtime hiding (Event (..), Label)
import Behavior.Internal.Signal.Filter (debounce, hysteresis, throttle)
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

-- | Simulates the world's program under a schedule, and returns what was observed, or the
-- reason why the run had no proper end.
observed :: Schedule -> World -> IO (Either String Seen)
observed how world = observing (simulateWith (limits world) {scheduled = how}) world

-- | Simulates the world's program under all schedules with up to the given number of
-- pre-emptions, but under no more schedules than the second number. Returns all that was
-- observed, and whether those were all the schedules.
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
  emittedRef <- newIORef []
  -- The steps of the run have the times of the transitions.
  let emit transition = modifyIORef' emittedRef (transition :) >> annotate (show transition)
  run <- simulated (behavior emit world)
  emitted <- reverse <$> readIORef emittedRef
  let record = recorded (Sim.steps run) emitted
      seen e = Right Seen {timeline = record, end = e}
      returnedWith = seen . Gave (ticks (finished run))
  evaluated $ case outcome run of
    Sim.Returned value -> returnedWith (Succeeded value)
    Sim.Failing e -> returnedWith (thrown e)
    Sim.Faulting e -> returnedWith (thrown e)
    Sim.Cancelled e -> returnedWith (thrown e)
    Sim.OutOfTime -> seen (Unknown (ticks (finished run)))
    Sim.Deadlock _ -> Left "a deadlock, though there is an end to wait for"
    Sim.Livelock labels -> Left ("livelock: " ++ show labels)
    Sim.BlockedOutside label' _ -> Left ("blocked outside: " ++ show label')
    Sim.ExternalWakeup waiting -> Left ("external wakeup: " ++ show waiting)
    Sim.TooSlow label' _ -> Left ("too slow: " ++ show label')
    Sim.ScheduleMismatch why -> Left ("schedule mismatch: " ++ why)
 where
  -- Evaluated, so that it does not keep the whole run in memory.
  evaluated whole = whole <$ evaluate (whole == whole)
  ticks = round
  recorded (s : others) transitions = case (did s, transitions) of
    (Note _, transition : later) -> (ticks (at s), transition) : recorded others later
    -- The relation has the ends of branches only.
    (Sim.Ends, _) | isBranch (label s) -> (ticks (at s), IsOver (show (label s))) : recorded others transitions
    _ -> recorded others transitions
  recorded [] _ = []
  isBranch (Label _ name) = name `notElem` ["", "polling", "clock", "staleAfter", "debounce", "debounce clock", "throttle", "hysteresis"]

-- | The state that a program runs with: the conditions, the number of calls of each action,
-- how to fork into the innermost scope, and the innermost shared signal.
data Stage = Stage
  { levels :: Map Condition (TVar Level)
  , calls :: IORef (Map Name Int)
  , forking :: Behavior Value -> Behavior (Child Value)
  , nearest :: Library.Signal Int
  }

-- | The world's program and environment. The given action receives each transition; it must
-- not be a scheduling point.
behavior :: (Transition -> IO ()) -> World -> Behavior Value
behavior emit world = do
  stage <- Stage <$> traverse newTVarIO (Map.fromList (conditions world)) <*> newIORef Map.empty <*> pure noNursery <*> pure (pure 0)
  let running = toBehavior emit stage (program world)
  case caller world of
    Operator -> firstOf [running, timeIsUp <$ environment stage]
    PlainThread type' later -> do
      thread <- mask_ (start (Sim.Label "plain thread" "") running)
      let interrupting = case type' of
            Asynchronous -> throwToAll (const Enough) [threadId thread]
            Synchronous -> throwToAll (const EnoughOfThis) [threadId thread]
      environment stage
      interrupting
      sleepUntil (fromIntegral (cancelAt world + later))
      interrupting
      atomically (threadEnd thread) >>= either throwIO pure
 where
  environment stage = do
    for_ (changes world) $ \(Change when condition level) -> do
      sleepUntil (fromIntegral when)
      for_ (Map.lookup condition (levels stage)) $ \var -> atomically (writeTVar var level)
      emit (condition `Becomes` level)
    sleepUntil (fromIntegral (cancelAt world))
  noNursery _ = throwIO (ErrorCall "a fork outside every scope")

toBehavior :: (Transition -> IO ()) -> Stage -> Program -> Behavior Value
toBehavior emit stage = go
 where
  go :: Program -> Behavior Value
  go = \case
    Do name scripts -> do
      checkpoint
      n <- atomicModifyIORef' (calls stage) $ \counts ->
        let n = Map.findWithDefault 0 name counts in (Map.insert name (n + 1) counts, n)
      act (emit . Action name) name (scripts !! min n (length scripts - 1))
    Pure value -> pure value
    Then first second -> go first >> go second
    Else first second -> go first ? go second
    Attempt n p -> attempt n (go p)
    FallbackOver ps -> fallbackOver ps go
    Parallel left right -> Unit <$ parallel (go left) (go right)
    Both left right -> Unit <$ both (go left) (go right)
    FirstOf ps -> firstOf (map go ps)
    AllOf ps -> Several <$> allOf (map go ps)
    Decide choice ps q -> decide (chosenFrom choice (go q)) (map go ps)
    RSelect signal left right -> rSelect (holds <$> level signal) (go left) (go right)
    Monitor signal recovery task -> monitor (holds <$> level signal) (void (go recovery)) (go task)
    InsteadWhen signal emergency p -> insteadWhen (holds <$> level signal) (go emergency) (go p)
    Switch signal branches -> switch (level signal) (\n -> go (branches !! max 0 (min n (length branches - 1))))
    TeleoReactive rules -> teleoReactive [(holds <$> level signal, go p) | (signal, p) <- rules]
    WaitUntil signal -> Unit <$ waitUntil (holds <$> level signal)
    WhileHolding signal p -> whileHolding (holds <$> level signal) (go p)
    Timeout limit p -> timeout (fromIntegral limit) (go p)
    WithShared signal p -> withShared (level signal) (\s -> toBehavior emit stage {nearest = s} p)
    Scoped body -> scoped (\nursery -> toBehavior emit stage {forking = fork nursery} body)
    Fork p -> Unit <$ forking stage (go p)
    Await p q -> forking stage (go p) >>= \child -> go q >> atomically (await child)
    StopChild p q -> forking stage (go p) >>= \child -> go q >> requestStop child >> atomically (await child)
  level = \case
    Watched condition -> watching (reading condition)
    Polled every p -> number <$> polling (fromIntegral every) (go p)
    And a b -> (\m n -> fromEnum (holds m && holds n)) <$> level a <*> level b
    Hysteresis initially low high signal -> fromEnum <$> hysteresis initially low high (level signal)
    Debounce n signal -> debounce (fromIntegral n) (level signal)
    Throttle n signal -> throttle (fromIntegral n) (level signal)
    StaleAfter n signal -> staleAfter (fromIntegral n) (level signal)
    Shared -> nearest stage
  reading :: Condition -> STM Int
  reading condition = case Map.lookup condition (levels stage) of
    Nothing -> retry
    Just var ->
      readTVar var >>= \case
        At n -> pure n
        NoValue -> retry
        Failing -> throwSTM (Failure condition)
        Faulting -> throwSTM (Fault condition)

-- | What 'Decide' runs, given these ends; if it has chosen.
chosenFrom :: Choice -> Behavior a -> [Maybe (Either BehaviorFailed b)] -> Maybe (Behavior a)
chosenFrom choice chosen ends' = case choice of
  AtLeast m
    | succeeded >= m -> Just chosen
    | succeeded + length (filter isNothing ends') < m -> Just (failWith "too few have succeeded")
  FirstEnd | end' : _ <- catMaybes ends' -> Just (either throwIO (const chosen) end')
  _ -> Nothing
 where
  succeeded = length [() | Just (Right _) <- ends']

-- | One call of an action.
act :: (ActionEvent -> IO ()) -> Name -> Script -> Behavior Value
act emit name script = do
  emit Begins
  mask $ \restore ->
    try (inState restore (wait (takes script))) >>= \case
      Right () -> finish name (ends script)
      Left e
        | not (isStopRequest e) -> throwIO e
        | otherwise -> do
            emit ReceivesStop
            case onStop script of
              StopsAtOnce -> throwIO e
              StopsAfter n -> clean n >> emit Stops >> throwIO e
              CleansUpInterruptibly n -> (wait n `onException` emit ReceivesStop) >> emit Stops >> throwIO e
              EndsAfter n how -> clean n >> finish (cleanupOf name) how
 where
  inState restore = case masking script of
    Unmasked -> restore
    Masked -> id
    Uninterruptible -> uninterruptibleMask_
  finish :: Name -> Ending -> IO Value
  finish name' how = do
    emit (Ends how)
    case how of
      Succeeds n -> pure (Number n)
      Fails -> throwIO (Failure name')
      Faults -> throwIO (Fault name')
  clean n = uninterruptibleMask_ (wait n)
  -- Zero ticks are a scheduling point, too: other threads can interrupt this one there, or
  -- run before it.
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

-- | Whether the exception stops the program; those of a 'PlainThread' do, of either type.
isStopRequest :: SomeException -> Bool
isStopRequest e = isCancellation e || isJust (fromException e :: Maybe EnoughOfThis)

-- | The exceptions that are thrown to a 'PlainThread', of an asynchronous and a synchronous
-- type.
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
