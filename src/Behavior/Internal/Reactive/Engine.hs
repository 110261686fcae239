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
import Data.Maybe (catMaybes)

import Behavior.Internal.Failure (Behavior)
import Behavior.Internal.Runtime (Label (..), atomically, tryReadThenBlock)
import Behavior.Internal.Scope
import Behavior.Internal.Signal.Source

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

-- | What follows a branch that has run to its end.
data Next a = BeginAgain | EndWith a

-- | The parts of a running operator that do not change.
data Engine k a = Engine
  { operator :: String
  , scope :: Scope
  , source :: Source k
  , reaction :: k -> Reaction a
  }

-- | What wakes the operator.
data Wakeup k a
  = BranchEnded (Outcome a)
  | Changed k !(Reaction a)
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
  structured $ \within ->
    startOver Engine {operator = name, scope = within, source = opened, reaction = toReaction} FirstRead

-- | Starts the sensors, and reads the signal.
startOver :: Eq k => Engine k a -> ReadMode -> IO (IO a)
startOver engine how = do
  (seen, sensors) <- startSensors (scope engine) (operator engine) (source engine)
  select engine sensors seen how

-- | Reads the signal, and does what its value requires. No branch runs.
select :: Eq k => Engine k a -> Sensors -> View k -> ReadMode -> IO (IO a)
select engine sensors seen how =
  atomically (readWakeup engine sensors (readView how seen)) >>= applyReaction engine sensors seen

-- | Reads the signal. That runs users' code (views, functions, equality): what that code throws
-- is caught here, so that any other exception in the operator's thread came from outside.
readWakeup :: Engine k a -> Sensors -> STM k -> STM (Wakeup k a)
readWakeup engine sensors value =
  sensorError sensors >>= \case
    Just dead -> pure (SensorDied dead)
    Nothing -> (value >>= \k -> pure $! Changed k (reaction engine k)) `catchSTM` (pure . SensorDied)

-- | Does what the wakeup requires. No branch runs.
applyReaction :: Eq k => Engine k a -> Sensors -> View k -> Wakeup k a -> IO (IO a)
applyReaction engine sensors seen = \case
  BranchEnded end -> pure (outcomeToIO end)
  SensorDied e -> pure (throwIO e)
  Changed _ (Conclude verdict) -> pure verdict
  Changed _ (RunToEnd name recovery) -> do
    requestStopAsync (map SomeBranch sensors)
    recover engine sensors name recovery Nothing
  Changed old Idle -> atomically (awaitChange old) >>= applyReaction engine sensors seen
  Changed old (Run name act) -> do
    running <- branch (scope engine) (Label (operator engine) name) act
    -- The branch is read first: one that has ended by itself is not interrupted, whatever
    -- the signal's value is in the same transaction.
    wakeup <-
      tryReadThenBlock (fmap BranchEnded <$> tryReadOutcome running) . atomically $
        tryReadOutcomeSTM running >>= maybe (awaitChange old) (pure . BranchEnded)
    case wakeup of
      BranchEnded end -> pure (outcomeToIO end)
      SensorDied e -> interrupt engine sensors running (Finish (throwIO e))
      Changed _ new -> interrupt engine sensors running $ case new of
        Conclude verdict -> Finish verdict
        RunToEnd name' recovery -> Recover name' recovery
        _ -> Reselect
 where
  awaitChange old = readWakeup engine sensors (reread seen >>= \new -> new <$ check (new /= old))

-- | Stops the branch. If it completes nevertheless, its result is that of the operator.
interrupt :: Eq k => Engine k a -> Sensors -> Branch a -> Interruption a -> IO (IO a)
interrupt engine sensors running = \case
  Finish verdict ->
    stopBranch sensors' >>= \case
      Stopped _ -> pure verdict
      end -> pure (outcomeToIO end)
  Recover name recovery ->
    stopBranch sensors' >>= \case
      Completed a -> pure (pure a)
      Stopped _ -> forget (scope engine) running >> recover engine sensors name recovery Nothing
      -- A cleanup that threw must not keep the robot from its charger.
      wrong -> recover engine sensors name recovery (Just (outcomeToIO wrong))
  Reselect ->
    stopBranch [] >>= \case
      -- Read again: meanwhile the value may have changed again, perhaps back to the old one.
      Stopped _ -> do
        forget (scope engine) running
        seen <- atomically (view (source engine))
        select engine sensors seen Reread
      end -> pure (outcomeToIO end)
 where
  sensors' = map SomeBranch sensors
  -- Waits for the branch, but not for the others.
  stopBranch others = requestStopAsync others >> requestStop [SomeBranch running] >> awaitOutcome running

-- | Runs the recovery to its end. The sensors' stop has been requested: the recovery does not
-- wait for those that are slow to stop, but what comes after it does.
recover :: Eq k => Engine k a -> Sensors -> String -> Behavior (Next a) -> Maybe (IO a) -> IO (IO a)
recover engine sensors name recovery taskOutcome = do
  recovered <- branch (scope engine) (Label (operator engine) name) recovery
  end <- awaitOutcome recovered
  case (result end, taskOutcome) of
    (_, Just verdict) -> pure verdict
    (Left wrong, Nothing) -> pure (throwIO wrong)
    (Right (EndWith a), Nothing) -> pure (pure a)
    (Right BeginAgain, Nothing) -> do
      forget (scope engine) recovered
      faults <- catMaybes <$> traverse (awaitStopped (scope engine)) sensors
      case faults of
        [] -> startOver engine Reread
        fault : _ -> pure (throwIO fault)

-- | Waits until a branch whose stop was requested has ended. If it faulted it stays
-- in the scope, which throws its fault.
awaitStopped :: Scope -> Branch () -> IO (Maybe SomeException)
awaitStopped within sensor =
  awaitOutcome sensor >>= \case
    Faulted fault -> pure (Just fault)
    _ -> Nothing <$ forget within sensor
