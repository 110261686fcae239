{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- The reactive engine: runs the branch for a signal's value, and interrupts it when the value
-- changes.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Reactive.Engine
  ( Response (..)
  , Next (..)
  , react
  , reactToCondition
  ) where

import Control.Concurrent.STM (STM, catchSTM, check)
import Control.Exception (SomeException, throwIO)
import GHC.Exts (lazy)

import Behavior.Internal.Concurrent.Outcome (Outcome (..), outcomeToIO, result)
import Behavior.Internal.Concurrent.Scope
import Behavior.Internal.Core.Cause (Cause (..))
import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Seam.Runtime (announce, atomically, tryReadThenBlock)
import Behavior.Internal.Signal.Source
import Behavior.Internal.Spans.Observer

-- | What an operator does for a value of the signal.
data Response a
  = -- | Run this branch (with its name) until it ends or the value changes.
    Run String (Behavior a)
  | -- | Run this branch to its end, without watching the signal.
    RunToEnd String (Behavior (Next a))
  | -- | Wait for another value.
    Idle
  | -- | End the operator: for this cause, or because the signal has this value.
    Conclude (Maybe Cause) (IO a)

-- | The name of the branch that the response starts.
branchOf :: Response a -> Maybe String
branchOf = \case
  Run name _ -> Just name
  RunToEnd name _ -> Just name
  _ -> Nothing

-- | What follows a branch that has run to its end.
data Next a = BeginAgain | EndWith a

-- | The parts of a running operator that do not change.
data Engine k a = Engine
  { scope :: Scope
  , source :: Source k
  , response :: k -> Response a
  , observer :: Observer
  }

-- | What wakes the operator, except the end of its branch.
data Wakeup k a
  = Changed k Values !(Response a)
  | SensorDied SomeException

-- | Gives the response to the signal's value, and changes to another when the value
-- changes. The list has the values whose branches a simulation is to expect.
react :: Eq k => String -> [k] -> Signal k -> (k -> Response a) -> Behavior a
react = reactNaming id

-- | The same for a condition, which a trace shows under the name \"condition\" if it has none.
reactToCondition :: String -> Signal Bool -> (Bool -> Response a) -> Behavior a
reactToCondition name = reactNaming (orNamed "condition") name [False, True]

reactNaming :: Eq k => (Source k -> Source k) -> String -> [k] -> Signal k -> (k -> Response a) -> Behavior a
reactNaming naming name expected signal toResponse = do
  announce name [next | k <- expected, Just next <- [branchOf (toResponse k)]]
  -- (No branch has been started yet: what 'open' throws is simply thrown.)
  opened <- openInTrace naming (suppressEqual signal) everyValue
  structured name $ \within -> do
    seen <- newObserver name
    ending seen (startOver Engine {scope = within, source = opened, response = toResponse, observer = seen} FirstRead)

-- | Starts the sensors, reads the signal, and does what its value requires.
startOver :: Eq k => Engine k a -> ReadMode -> IO (Verdict a)
startOver engine how = do
  -- (Lazy: otherwise GHC passes the source's fields here, and builds the source again for the engine.)
  (seen, sensors) <- startSensors (scope engine) (lazy (source engine))
  wakeup <- atomically (readWakeup engine sensors seen $! readView how seen)
  cause <- decidesOn engine wakeup
  applyResponse engine sensors seen cause wakeup

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
    values <- observed (observer engine) (readings seen)
    pure $! Changed k values (response engine k)

-- | The cause for which the operator stops its branch, or its sensors, now.
decidesOn :: Engine k a -> Wakeup k a -> IO Cause
decidesOn engine = \case
  SensorDied _ -> pure (SiblingFailed "sensor")
  Changed _ _ (Conclude (Just cause) _) -> pure cause
  Changed _ values next -> decides (observer engine) (isReaction next) values
 where
  -- Whether the response is a reaction even to the first values that the operator reads.
  isReaction next = case next of
    RunToEnd _ _ -> True
    Conclude _ _ -> True
    _ -> False

-- | Does what the wakeup requires. No branch runs.
applyResponse :: Eq k => Engine k a -> Sensors -> View k -> Cause -> Wakeup k a -> IO (Verdict a)
applyResponse engine sensors seen cause = \case
  SensorDied e -> pure (Verdict cause (throwIO e))
  Changed _ _ (Conclude _ verdict) -> pure (Verdict cause verdict)
  Changed _ _ (RunToEnd name recovery) -> do
    requestStopAsync cause (map SomeBranch sensors)
    recover engine sensors cause name recovery Nothing
  Changed old _ Idle -> do
    waits (observer engine)
    change <- atomically (awaitChange old)
    why <- decidesOn engine change
    applyResponse engine sensors seen why change
  Changed old _ (Run name act) -> do
    running <- starts (observer engine) name (branch (scope engine) name act)
    -- The branch is read first: one that has ended by itself is not interrupted, whatever
    -- the signal's value is in the same transaction.
    wakeup <-
      tryReadThenBlock (fmap Left <$> tryReadOutcome running) . atomically $
        tryReadOutcomeSTM running >>= maybe (Right <$> awaitChange old) (pure . Left)
    case wakeup of
      Left end -> pure $! endedBy name end
      Right change -> do
        why <- decidesOn engine change
        interrupt engine sensors why name running change
 where
  awaitChange old = readWakeup engine sensors seen (reread seen >>= \new -> new <$ check (new /= old))

-- | Stops the branch with this name, for that cause, and does what the wakeup requires. If the branch completes
-- nevertheless, its result is that of the operator.
interrupt :: Eq k => Engine k a -> Sensors -> Cause -> String -> Branch a -> Wakeup k a -> IO (Verdict a)
interrupt engine sensors cause name running = \case
  SensorDied e -> concluding (throwIO e)
  Changed _ _ (Conclude _ verdict) -> concluding verdict
  Changed _ _ (RunToEnd recoveryName recovery) ->
    stopBranch sensorBranches >>= \end -> case end of
      Completed _ -> pure $! endedBy name end
      Stopped _ -> forget (scope engine) running >> recover engine sensors cause recoveryName recovery Nothing
      -- A cleanup that threw must not keep the robot from its charger.
      _ -> recover engine sensors cause recoveryName recovery (Just (outcomeToIO end))
  Changed {} ->
    stopBranch [] >>= \end -> case end of
      -- Read again: meanwhile the value may have changed again, perhaps back to the old one.
      Stopped _ -> do
        forget (scope engine) running
        (seen, wakeup) <- readAgain
        applyResponse engine sensors seen cause wakeup
      _ -> pure $! endedBy name end
 where
  sensorBranches = map SomeBranch sensors
  concluding verdict =
    stopBranch sensorBranches >>= \end -> pure $! case end of
      Stopped _ -> Verdict cause verdict
      _ -> endedBy name end
  -- Waits for the branch, but not for the others.
  stopBranch others = do
    requestStopAsync cause others
    requestStop cause [SomeBranch running]
    end <- awaitOutcome running
    end <$ hasStopped (observer engine) (result end)
  readAgain = do
    seen <- atomically (view (source engine))
    wakeup <- atomically (readWakeup engine sensors seen $! reread seen)
    case wakeup of
      Changed _ values _ -> rereads (observer engine) values
      SensorDied _ -> pure ()
    pure (seen, wakeup)

-- | Runs the recovery to its end. The stop of the sensors has been requested: the recovery does not
-- wait for sensors that are slow to stop, but what comes after it does.
recover :: Eq k => Engine k a -> Sensors -> Cause -> String -> Behavior (Next a) -> Maybe (IO a) -> IO (Verdict a)
recover engine sensors cause name recovery taskOutcome = do
  recovered <- starts (observer engine) name (branch (scope engine) name recovery)
  end <- awaitOutcome recovered
  case (result end, taskOutcome) of
    (_, Just verdict) -> concluding verdict
    (Left wrong, Nothing) -> concluding (throwIO wrong)
    (Right (EndWith a), Nothing) -> concluding (pure a)
    (Right BeginAgain, Nothing) -> do
      forget (scope engine) recovered
      ends <- traverse awaitOutcome sensors
      -- (A sensor that has faulted stays in the scope.)
      _ <- forgetEnded (scope engine)
      case [fault | FaultedWith fault <- ends] of
        [] -> startOver engine Reread
        fault : _ -> concluding (throwIO fault)
 where
  -- (Only sensors are left, whose stop has been requested.)
  concluding = pure . Verdict cause
