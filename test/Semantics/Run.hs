{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Runs a program of the specification with the library's operators, in the simulator.
module Semantics.Run
  ( observed
  , allObserved

    -- * Runs of which more is observed
  , Instrument (..)
  , observedWith
  , operatorName
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
import Data.List (isPrefixOf)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (catMaybes, fromMaybe, isJust, isNothing)
import Data.Set (Set)
import qualified Data.Set as Set

import Behavior.Internal.Failure
import Behavior.Internal.Nursery
import Behavior.Internal.Parallel (allOf, both, decide, firstOf, parallel)
import Behavior.Internal.Reactive.Operators
import Behavior.Internal.Reactive.Timeout
import Behavior.Internal.Runtime
import Behavior.Internal.Signal.Filter (debounce, hysteresis, throttle)
import Behavior.Internal.Signal.Polling
import Behavior.Internal.Signal.Shared (withShared)
import Behavior.Internal.Signal.Source (watching)
import qualified Behavior.Internal.Signal.Source as Library
import Behavior.Sim
  ( StepKind (Note)
  , SimOptions (endAt, scheduled, timerSlip, livelockLimit)
  , Plan (..)
  , Report (reportComplete)
  , Run (finished, outcome)
  , Schedule
  , Search (Exhaustive)
  , Step (stepTime, stepKind, stepLabel)
  , defaultSimOptions
  , exhaustively
  , explore
  , simulateWith
  )
import qualified Behavior.Sim as Sim
import Semantics.Path (End (..), Seen (..))
import Semantics.Program

-- | Simulates the world's program under a schedule, and returns what was observed, or the
-- reason why the run had no proper end.
observed :: Schedule -> World -> IO (Either String Seen)
observed how world = fst <$> observedWith plain how world

-- | Likewise, with an instrument; gives the whole run, too.
observedWith :: Instrument position -> Schedule -> World -> IO (Either String Seen, Run Value)
observedWith instrument how world = observing instrument (simulateWith (limits world) {scheduled = how}) world

-- | What is done around the parts of a program, each of which has a position in it.
data Instrument position = Instrument
  { root :: position
  , inBranch :: String -> position -> position
  -- ^ The position in the branch with this label, of the operator with that position.
  , aroundAll :: Behavior Value -> Behavior Value
  , aroundPart :: position -> Program -> (position -> position -> Behavior Value) -> Behavior Value
  -- ^ What runs is a function of its position, and of that within it, if it is an operator.
  , aroundCleanup :: position -> Behavior () -> Behavior ()
  , whenSet :: Condition -> Level -> IO ()
  -- ^ When a condition has changed.
  , ofSignal :: Maybe Condition -> Library.Signal Int -> Library.Signal Int
  -- ^ For the whole signal of an operator (but of withShared), and for each condition.
  }

-- | Nothing is done around anything.
plain :: Instrument ()
plain =
  Instrument
    { root = ()
    , inBranch = \_ _ -> ()
    , aroundAll = id
    , aroundPart = \_ _ run -> run () ()
    , aroundCleanup = const id
    , whenSet = \_ _ -> pure ()
    , ofSignal = const id
    }

-- | The operator at the top of a program, if there is one.
operatorName :: Program -> Maybe String
operatorName = \case
  Parallel _ _ -> Just "parallel"
  Both _ _ -> Just "both"
  FirstOf _ -> Just "firstOf"
  AllOf _ -> Just "allOf"
  Decide {} -> Just "decide"
  RSelect {} -> Just "rSelect"
  Monitor {} -> Just "monitor"
  InsteadWhen {} -> Just "insteadWhen"
  Switch _ _ -> Just "switch"
  TeleoReactive _ -> Just "teleoReactive"
  WaitUntil _ -> Just "waitUntil"
  WhileHolding _ _ -> Just "whileHolding"
  Timeout _ _ -> Just "timeout"
  WithShared _ _ -> Just "withShared"
  Scoped _ -> Just "scoped"
  _ -> Nothing

-- | Simulates the world's program under all schedules with up to the given number of
-- pre-emptions, but under no more schedules than the second number. Returns all that was
-- observed, and whether those were all the schedules.
allObserved :: Int -> Int -> World -> IO (Set (Either String Seen), Bool)
allObserved preemptions most world = do
  found <- newIORef Set.empty
  let all' = (exhaustively preemptions) {planSearch = Exhaustive preemptions most, planOptions = limits world}
  report <- explore all' $ \simulated ->
    observing plain simulated world >>= \(seen, _) -> modifyIORef' found (Set.insert seen)
  found' <- readIORef found
  pure (found', reportComplete report)

-- | A run without an end is cut short.
limits :: World -> SimOptions
limits world = defaultSimOptions {livelockLimit = 20000, endAt = 60, timerSlip = fromIntegral (slippage world)}

observing :: Instrument position -> (Behavior Value -> IO (Run Value)) -> World -> IO (Either String Seen, Run Value)
observing instrument simulated world = do
  emittedRef <- newIORef []
  -- The steps of the run have the times of the transitions.
  let emit transition = modifyIORef' emittedRef (transition :) >> annotate (show transition)
  run <- simulated (aroundAll instrument (behavior instrument emit world))
  emitted <- reverse <$> readIORef emittedRef
  let record = recorded (Sim.steps run) emitted
      seen e = Right Seen {timeline = record, end = e}
      returnedWith = seen . Gave (ticks (finished run))
  fmap (\it -> (it, run)) . evaluated $ case outcome run of
    Sim.Returned value -> returnedWith (Succeeded value)
    Sim.Threw e -> returnedWith (thrown e)
    Sim.OutOfTime _ -> seen (Unknown (ticks (finished run)))
    Sim.Deadlock _ -> seen (Unknown (ticks (finished run)))
    Sim.Livelock labels _ -> Left ("livelock: " ++ show labels)
    Sim.BlockedOutside label' _ -> Left ("blocked outside: " ++ show label')
    Sim.ExternalWakeup waiting -> Left ("external wakeup: " ++ show waiting)
    Sim.TooSlow label' _ -> Left ("too slow: " ++ show label')
    Sim.ScheduleMismatch why -> Left ("schedule mismatch: " ++ why)
 where
  -- Evaluated, so that it does not keep the whole run in memory.
  evaluated whole = whole <$ evaluate (whole == whole)
  ticks = round
  recorded (s : others) transitions = case (stepKind s, transitions) of
    (Note text, transition : later)
      | text == show transition -> (ticks (stepTime s), transition) : recorded others later
    -- The relation has the ends of branches only.
    (Sim.Ends, _)
      | isBranch (stepLabel s) -> (ticks (stepTime s), IsOver (show (stepLabel s))) : recorded others transitions
    _ -> recorded others transitions
  recorded [] _ = []
  isBranch (Label _ name) =
    name `notElem` ["", "polling", "clock", "staleAfter", "debounce", "debounce clock", "throttle", "hysteresis"]

-- | The state that a program runs with: the conditions, the number of calls of each action,
-- how to fork into the innermost scope, and the innermost shared signal.
data Context position = Context
  { levels :: Map Condition (TVar Level)
  , calls :: IORef (Map Name Int)
  , forking :: (position -> Behavior Value) -> Behavior (Child Value)
  , nearest :: Library.Signal Int
  }

-- | The world's program and environment. The given action receives each transition; it must
-- not be a scheduling point.
behavior :: Instrument position -> (Transition -> IO ()) -> World -> Behavior Value
behavior instrument emit world = do
  context <-
    Context
      <$> traverse newTVarIO (Map.fromList (conditions world))
      <*> newIORef Map.empty
      <*> pure noNursery
      <*> pure (pure 0)
  let running at' = toBehavior instrument emit context at' (program world)
  case caller world of
    Operator -> aroundPart instrument (root instrument) (FirstOf [program world]) $ \_ within ->
      firstOf [running (inBranch instrument "firstOf: 1" within), timeIsUp <$ environment context]
    PlainThread type' later -> do
      thread <-
        mask_ (start (Label "plain thread" "") (running (inBranch instrument "plain thread" (root instrument))))
      let interrupting = case type' of
            Asynchronous -> throwToAll (const Enough) [threadId thread]
            Synchronous -> throwToAll (const EnoughOfThis) [threadId thread]
      environment context
      interrupting
      sleepUntil (fromIntegral (cancelAt world + later))
      interrupting
      atomically (threadEnd thread) >>= either throwIO pure
 where
  environment context = do
    for_ (changes world) $ \(Change when condition level) -> do
      sleepUntil (fromIntegral when)
      for_ (Map.lookup condition (levels context)) $ \var ->
        atomically (writeTVar var level) >> whenSet instrument condition level
      emit (condition `Becomes` level)
    sleepUntil (fromIntegral (cancelAt world))
  noNursery _ = throwIO (ErrorCall "a fork outside every scope")

toBehavior :: Instrument position -> (Transition -> IO ()) -> Context position -> position -> Program -> Behavior Value
toBehavior instrument emit context = go
 where
  -- A part, and how it runs at its position; an operator's parts have the position within it.
  go here p = aroundPart instrument here p (part p)
  part p outer within = case p of
    Do name scripts -> do
      checkpoint
      n <- atomicModifyIORef' (calls context) $ \counts ->
        let n = Map.findWithDefault 0 name counts in (Map.insert name (n + 1) counts, n)
      act (emit . Action name) (aroundCleanup instrument outer) name (scripts !! min n (length scripts - 1))
    Pure value -> pure value
    Then first second -> go outer first >> go outer second
    Else first second -> go outer first ? go outer second
    Attempt n q -> attempt n (go outer q)
    FallbackOver ps -> fallbackOver ps (go outer)
    Parallel left right -> Unit <$ parallel (branch "left" left) (branch "right" right)
    Both left right -> Unit <$ both (branch "left" left) (branch "right" right)
    FirstOf ps -> firstOf (numbered ps)
    AllOf ps -> Several <$> allOf (numbered ps)
    Decide choice ps q -> decide (chosenFrom choice (go outer q)) (numbered ps)
    RSelect signal left right -> rSelect (holds <$> level signal) (branch "left" left) (branch "right" right)
    Monitor signal recovery task ->
      monitor (holds <$> level signal) (void (branch "recovery" recovery)) (branch "task" task)
    InsteadWhen signal emergency q ->
      insteadWhen (holds <$> level signal) (branch "emergency" emergency) (branch "branch" q)
    Switch signal branches ->
      switch (level signal) (\n -> branch "branch" (branches !! max 0 (min n (length branches - 1))))
    TeleoReactive rules ->
      teleoReactive
        [(holds <$> level signal, branch ("rule " ++ show n) q) | (n, (signal, q)) <- zip [1 :: Int ..] rules]
    WaitUntil signal -> Unit <$ waitUntil (holds <$> level signal)
    WhileHolding signal q -> whileHolding (holds <$> level signal) (branch "branch" q)
    Timeout limit q -> timeout (fromIntegral limit) (branch "branch" q)
    WithShared signal q ->
      withShared (levelIn (labelled "polling") signal) $ \s ->
        toBehavior instrument emit context {nearest = s} (labelled "body") q
    Scoped body -> scoped $ \nursery ->
      toBehavior
        instrument
        emit
        context {forking = \child -> fork nursery (child (labelled "fork"))}
        (labelled "body")
        body
    Fork q -> Unit <$ forking context (`go` q)
    Await q r -> forking context (`go` q) >>= \child -> go outer r >> atomically (await child)
    StopChild q r -> forking context (`go` q) >>= \child -> go outer r >> requestStop child >> atomically (await child)
   where
    labelled name = inBranch instrument (fromMaybe "" (operatorName p) ++ ": " ++ name) within
    branch name = go (labelled name)
    numbered ps = [branch (show n) q | (n, q) <- zip [1 :: Int ..] ps]
    level signal = ofSignal instrument Nothing (levelIn (labelled "polling") signal)
  levelIn sensor = \case
    Watched condition -> ofSignal instrument (Just condition) (watching (reading condition))
    Polled every p -> number <$> polling (fromIntegral every) (go sensor p)
    And a b -> (\m n -> fromEnum (holds m && holds n)) <$> levelIn sensor a <*> levelIn sensor b
    Hysteresis initially low high signal -> fromEnum <$> hysteresis initially low high (levelIn sensor signal)
    Debounce n signal -> debounce (fromIntegral n) (levelIn sensor signal)
    Throttle n signal -> throttle (fromIntegral n) (levelIn sensor signal)
    StaleAfter n signal -> staleAfter (fromIntegral n) (levelIn sensor signal)
    Shared -> nearest context
  reading :: Condition -> STM Int
  reading condition = case Map.lookup condition (levels context) of
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
act :: (ActionEvent -> IO ()) -> (Behavior () -> Behavior ()) -> Name -> Script -> Behavior Value
act emit cleaning name script = do
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
              CleansUpInterruptibly n -> (cleaning (wait n) `onException` emit ReceivesStop) >> emit Stops >> throwIO e
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
  clean n = uninterruptibleMask_ (cleaning (wait n))
  -- Zero ticks are a scheduling point, too: other threads can interrupt this one there, or
  -- run before it.
  wait n = if n > 0 then sleep (fromIntegral n) else checkpoint

-- | An exception that the run ended with, as a result.
thrown :: SomeException -> Result
thrown e
  | Just (StoppedWithFault _ fault) <- fromException e = Stopped (Just (show fault))
  | isStopRequest e = Stopped Nothing
  | Just (BehaviorFailed _ failure) <- fromException e = FailedWith (withoutNames (show failure))
  | otherwise = FaultedWith (show e)

-- | The text of a failure; the relation does not name the signals of a condition.
withoutNames :: String -> String
withoutNames text = if (init doesNotHold ++ ": ") `isPrefixOf` text then doesNotHold else text

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
