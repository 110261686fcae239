{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- The reactive engine: runs the branch for a signal's value, and interrupts it when the value
-- changes.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Reactive.Engine
  ( Reaction (..)
  , Next (..)
  , react
  ) where

import Control.Concurrent.STM (STM, catchSTM, check)
import Control.Exception (SomeException, throwIO)
import Data.Maybe (isJust)

import Behavior.Internal.Failure (Behavior)
import Behavior.Internal.Runtime (Label (..), Seconds, atomically, tryReadThenBlock)
import Behavior.Internal.Scope
import Behavior.Internal.Signal.Source
import Behavior.Internal.Trace.Decision
import Behavior.Internal.Trace.Place (Place, myPlace)

-- | What an operator does for a value of the signal.
data Reaction a
  = -- | Run this branch (with its name) until it ends or the value changes.
    Run String (Behavior a)
  | -- | Run this branch to its end, without watching the signal.
    RunToEnd String (Behavior (Next a))
  | -- | Wait for another value.
    Idle
  | -- | End the operator.
    Conclude (IO a)
  | -- | End the operator, because this time limit has passed.
    TimeIsUp Seconds (IO a)

-- | What follows a branch that has run to its end.
data Next a = BeginAgain | EndWith a

-- | The parts of a running operator that do not change.
data Engine k a = Engine
  { operator :: String
  , scope :: Scope
  , source :: Source k
  , reaction :: k -> Reaction a
  , place :: Maybe Place
  -- ^ Where it is in a trace, which shows the named values of the signal.
  }

-- | What wakes the operator.
data Wakeup k a
  = BranchEnded (Outcome a)
  | Changed k Values !(Reaction a)
  | SensorDied SomeException

-- | Why a branch is stopped: what the operator does after the branch has ended.
data Interruption a
  = Reselect
  | Recover String (Behavior (Next a))
  | Finish (IO a)

-- | Runs the reaction to the signal's value, and changes to another reaction when the value
-- changes.
react :: Eq k => String -> Signal k -> (k -> Reaction a) -> Behavior a
react name signal toReaction = do
  -- (No branch has been started yet: what 'open' throws is simply thrown.)
  opened <- open (suppressEqual signal) everyValue
  structured name $ \within -> do
    here <- myPlace
    startOver
      Engine {operator = name, scope = within, source = opened, reaction = toReaction, place = here}
      FirstRead
      Nothing

-- | Starts the sensors, reads the signal, and does what its value requires. (The values are those of
-- the decision before.)
startOver :: Eq k => Engine k a -> ReadMode -> Maybe Values -> IO (Verdict a)
startOver engine how before = do
  (seen, sensors) <- startSensors (scope engine) (operator engine) (source engine)
  wakeup <- atomically (readWakeup engine sensors seen (readView how seen))
  decideOn engine Nothing before wakeup >>= applyReaction engine sensors seen wakeup

-- | Reads the signal. That runs users' code (views, functions, equality): what that code throws
-- is caught here, so that any other exception in the operator's thread came from outside.
readWakeup :: Engine k a -> Sensors -> View k -> STM k -> STM (Wakeup k a)
readWakeup engine sensors seen value =
  sensorError sensors >>= \case
    Just dead -> pure (SensorDied dead)
    Nothing -> changed `catchSTM` (pure . SensorDied)
 where
  changed = do
    k <- value
    values <- if isJust (place engine) then readings seen else pure []
    pure $! Changed k values (reaction engine k)

-- | What the operator has decided, for the trace: which branch runs, and the values of the decision
-- before.
decideOn :: Engine k a -> Maybe Ran -> Maybe Values -> Wakeup k a -> IO Decision
decideOn engine ran before = \case
  Changed _ _ (TimeIsUp limit _) -> pure (timeIsUp limit)
  Changed _ values next -> case place engine of
    Nothing -> pure (begins [])
    Just here
      | isJust before || isReaction next -> decide here (operator engine) ran before values
      | otherwise -> pure (begins values)
  _ -> pure sensorDied
 where
  -- At the beginning.
  isReaction next = case next of
    RunToEnd _ _ -> True
    Conclude _ -> True
    _ -> False

-- | Does what the wakeup requires. No branch runs.
applyReaction :: Eq k => Engine k a -> Sensors -> View k -> Wakeup k a -> Decision -> IO (Verdict a)
applyReaction engine sensors seen woken decision = case woken of
  BranchEnded end -> pure (endedBy "branch" end)
  SensorDied e -> concluding (throwIO e)
  Changed _ _ (Conclude verdict) -> concluding verdict
  Changed _ _ (TimeIsUp _ verdict) -> concluding verdict
  Changed _ _ (RunToEnd name recovery) -> do
    orReported decision (requestStopAsync (cause decision) (map SomeBranch sensors))
    recover engine sensors decision name recovery Nothing
  Changed old values Idle -> do
    report decision Nothing
    change <- atomically (awaitChange old)
    decideOn engine Nothing (Just values) change >>= applyReaction engine sensors seen change
  Changed old values (Run name act) -> do
    report decision (Just name)
    ran <- traverse (`branchBegins` name) (place engine)
    running <- starting decision (branch (scope engine) (Label (operator engine) name) act)
    -- The branch is read first: one that has ended by itself is not interrupted, whatever
    -- the signal's value is in the same transaction.
    wakeup <-
      tryReadThenBlock (fmap BranchEnded <$> tryReadOutcome running) . atomically $
        tryReadOutcomeSTM running >>= maybe (awaitChange old) (pure . BranchEnded)
    let interrupting next = decideOn engine ran (Just values) wakeup >>= interrupt engine sensors name running next
    case wakeup of
      BranchEnded end -> pure (endedBy name end)
      SensorDied e -> interrupting (Finish (throwIO e))
      Changed _ _ new -> interrupting $ case new of
        Conclude verdict -> Finish verdict
        TimeIsUp _ verdict -> Finish verdict
        RunToEnd name' recovery -> Recover name' recovery
        _ -> Reselect
 where
  awaitChange old = readWakeup engine sensors seen (reread seen >>= \new -> new <$ check (new /= old))
  concluding verdict = Verdict (cause decision) verdict <$ report decision Nothing

-- | Stops the branch with this name. If it completes nevertheless, its result is that of the operator.
interrupt :: Eq k => Engine k a -> Sensors -> String -> Branch a -> Interruption a -> Decision -> IO (Verdict a)
interrupt engine sensors name running next decision = case next of
  Finish verdict ->
    stopBranch sensors' >>= \(end, stopped) -> case end of
      Stopped _ -> Verdict (cause decision) verdict <$ report stopped Nothing
      _ -> ended stopped end
  Recover name' recovery ->
    stopBranch sensors' >>= \(end, stopped) -> case end of
      Completed _ -> ended stopped end
      Stopped _ -> forget (scope engine) running >> recover engine sensors stopped name' recovery Nothing
      -- A cleanup that threw must not keep the robot from its charger.
      _ -> recover engine sensors stopped name' recovery (Just (outcomeToIO end))
  Reselect ->
    stopBranch [] >>= \(end, stopped) -> case end of
      -- Read again: meanwhile the value may have changed again, perhaps back to the old one.
      Stopped _ -> do
        forget (scope engine) running
        (seen, woken) <- orReported stopped readAgain
        applyReaction engine sensors seen woken stopped
      _ -> ended stopped end
 where
  sensors' = map SomeBranch sensors
  ended stopped end = endedBy name end <$ report stopped Nothing
  -- Waits for the branch, but not for the others.
  stopBranch others = orReported decision $ do
    end <- stopIt others
    (,) end <$> hasStopped (result end) decision
  stopIt others = do
    requestStopAsync (cause decision) others
    requestStop (cause decision) [SomeBranch running]
    awaitOutcome running
  readAgain = do
    seen <- atomically (view (source engine))
    (,) seen <$> atomically (readWakeup engine sensors seen (reread seen))

-- | Runs the recovery to its end. The sensors' stop has been requested: the recovery does not
-- wait for those that are slow to stop, but what comes after it does.
recover :: Eq k => Engine k a -> Sensors -> Decision -> String -> Behavior (Next a) -> Maybe (IO a) -> IO (Verdict a)
recover engine sensors decision name recovery taskOutcome = do
  report decision (Just name)
  recovered <- starting decision (branch (scope engine) (Label (operator engine) name) recovery)
  end <- awaitOutcome recovered
  case (result end, taskOutcome) of
    (_, Just verdict) -> concluding verdict
    (Left wrong, Nothing) -> concluding (throwIO wrong)
    (Right (EndWith a), Nothing) -> concluding (pure a)
    (Right BeginAgain, Nothing) -> do
      forget (scope engine) recovered
      ends <- traverse awaitOutcome sensors
      -- (What has faulted stays in the scope.)
      _ <- forgetEnded (scope engine)
      case [fault | Faulted fault <- ends] of
        [] -> startOver engine Reread (Just (decidedOn decision))
        fault : _ -> concluding (throwIO fault)
 where
  -- (Only sensors are left, whose stop has been requested.)
  concluding = pure . Verdict (cause decision)
