{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- The reactive engine, and the operators that are a few lines on it.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Reactive
  ( -- * The engine
    Reaction (..)
  , react

    -- * Interrupting
  , rSelect
  , monitor

    -- * Many branches
  , switch
  , teleoReactive

    -- * Waiting for a condition, and holding to one
  , waitUntil
  , whileHolding
  ) where

import Control.Concurrent.STM (STM, catchSTM, check)
import Control.Exception (SomeException, throwIO)
import Data.List (findIndex)
import Data.Maybe (catMaybes)

import Behavior.Internal.Failure (Behavior, failWith)
import Behavior.Internal.Runtime (Label (..), atomically, tryReadThenBlock)
import Behavior.Internal.Scope
import Behavior.Internal.Source

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Time (atomically)
-- >>> import qualified Behavior.Signal as Signal

-- | What to do for a value of the signal.
data Reaction a
  = -- | Run this branch (with its name) until it ends or the value changes.
    Run String (Behavior a)
  | -- | Run this branch to its end, with nothing watched, then begin again.
    RunToEnd String (Behavior ())
  | -- | Wait for another value.
    Idle
  | -- | End the operator.
    Conclude (IO a)

-- | What an operator works with for as long as it runs.
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

-- | Why a branch is stopped: what is to come once it has ended.
data Interruption a
  = Reselect
  | Recover String (Behavior ())
  | Finish (IO a)

-- | Runs what the reaction to the signal's value says, and switches when it says
-- something else.
react :: Eq k => String -> Signal k -> (k -> Reaction a) -> Behavior a
react name signal reacting = do
  -- (Before any branch is started: what opening throws needs no care.)
  opened <- open (suppressEqual signal) anything
  structured $ \within ->
    begin Engine {operator = name, scope = within, source = opened, reaction = reacting} FirstRead

-- | Starts the sensors, and looks.
begin :: Eq k => Engine k a -> Look -> IO (IO a)
begin engine how = do
  (seen, sensors) <- startSensors (scope engine) (operator engine) (source engine)
  select engine sensors seen how

-- | Nothing runs: reads, and does what the value says now.
select :: Eq k => Engine k a -> Sensors -> View k -> Look -> IO (IO a)
select engine sensors seen how =
  atomically (changed engine sensors (lookAt how seen)) >>= follow engine sensors seen

-- | What a look at the signal says. It runs users' code (views, functions, equality): what that
-- throws is caught here, so that what is thrown elsewhere in the operator's thread came from
-- outside.
changed :: Engine k a -> Sensors -> STM k -> STM (Wakeup k a)
changed engine sensors value =
  diedOf sensors >>= \case
    Just dead -> pure (SensorDied dead)
    Nothing -> (value >>= \k -> pure $! Changed k (reaction engine k)) `catchSTM` (pure . SensorDied)

-- | Does what the wakeup says; no branch runs.
follow :: Eq k => Engine k a -> Sensors -> View k -> Wakeup k a -> IO (IO a)
follow engine sensors seen = \case
  BranchEnded end -> pure (outcomeToIO end)
  SensorDied e -> pure (throwIO e)
  Changed _ (Conclude verdict) -> pure verdict
  Changed _ (RunToEnd name recovery) -> do
    requestStopAsync (map SomeBranch sensors)
    recover engine sensors name recovery Nothing
  Changed old Idle -> atomically (changedFrom old) >>= follow engine sensors seen
  Changed old (Run name act) -> do
    running <- branch (scope engine) (Label (operator engine) name) act
    -- The branch is looked at first: one that has ended by itself is not
    -- interrupted, whatever the signal says in the same transaction.
    wakeup <-
      tryReadThenBlock (fmap BranchEnded <$> tryReadOutcome running) . atomically $
        tryReadOutcomeSTM running >>= maybe (changedFrom old) (pure . BranchEnded)
    case wakeup of
      BranchEnded end -> pure (outcomeToIO end)
      SensorDied e -> interrupt engine sensors running (Finish (throwIO e))
      Changed _ new -> interrupt engine sensors running $ case new of
        Conclude verdict -> Finish verdict
        RunToEnd name' recovery -> Recover name' recovery
        _ -> Reselect
 where
  changedFrom old = changed engine sensors (reread seen >>= \new -> new <$ check (new /= old))

-- | Stops the branch. If it completes all the same, it has completed, and that is the end.
interrupt :: Eq k => Engine k a -> Sensors -> Branch a -> Interruption a -> IO (IO a)
interrupt engine sensors running = \case
  Finish verdict ->
    stop sensors' >>= \case
      Stopped _ -> pure verdict
      end -> pure (outcomeToIO end)
  Recover name recovery ->
    stop sensors' >>= \case
      Completed a -> pure (pure a)
      Stopped _ -> forget (scope engine) running >> recover engine sensors name recovery Nothing
      -- A cleanup that went wrong must not keep the robot from its charger.
      wrong -> recover engine sensors name recovery (Just (outcomeToIO wrong))
  Reselect ->
    stop [] >>= \case
      -- Read again: by now the value may be another, or the old one again.
      Stopped _ -> do
        forget (scope engine) running
        seen <- atomically (view (source engine))
        select engine sensors seen Reread
      end -> pure (outcomeToIO end)
 where
  sensors' = map SomeBranch sensors
  -- It waits for the branch, but not for the others.
  stop others = requestStopAsync others >> requestStop [SomeBranch running] >> awaitOutcome running

-- | Runs the recovery to its end. The sensors were asked to stop: it does not wait for
-- those that are slow to, but what comes after it does.
recover :: Eq k => Engine k a -> Sensors -> String -> Behavior () -> Maybe (IO a) -> IO (IO a)
recover engine sensors name recovery aftermath = do
  recovered <- branch (scope engine) (Label (operator engine) name) recovery
  end <- awaitOutcome recovered
  case (result end, aftermath) of
    (_, Just verdict) -> pure verdict
    (Left wrong, Nothing) -> pure (throwIO wrong)
    (Right (), Nothing) -> do
      forget (scope engine) recovered
      faults <- catMaybes <$> traverse (awaitStopped (scope engine)) sensors
      case faults of
        [] -> begin engine Reread
        fault : _ -> pure (throwIO fault)

-- | Waits until a branch whose stop was requested has ended. If it faulted it stays
-- in the scope, which throws its fault.
awaitStopped :: Scope -> Branch () -> IO (Maybe SomeException)
awaitStopped within sensor =
  awaitOutcome sensor >>= \case
    Faulted fault -> pure (Just fault)
    _ -> Nothing <$ forget within sensor

-- | A reactive @if@: runs @left@ while the condition is true and @right@ while it
-- is false, and switches whenever it changes.
--
-- > rSelect (pure True) left right  =  left
-- > rSelect condition left right    =  switch condition (\c -> if c then left else right)
--
-- The condition is read before anything starts. When it changes, the branch that
-- runs is stopped; when that has ended, cleanup included, the condition is read
-- again, and what it says then starts (perhaps the same branch, anew).
--
-- [Result] That of the branch that completed, also of one that was asked to stop
--   and completed all the same.
-- [Failure] A branch that fails, also while it is being stopped, ends the
--   operator with its failure. A condition that fails, or that has no value any
--   more, is not \"false\": the branch is stopped and the operator fails.
-- [Fault] Of a branch or the condition, also while stopping: thrown, after all has
--   ended. Nothing else starts.
-- [Cancellation] The branch and the sensors are asked to stop at once; it returns
--   after they have ended.
--
-- >>> Signal.rSelect (pure True) (pure "left") (pure "right")
-- "left"
--
-- /Definition 3.1 and Section 5 of the paper, with a signal for the condition./
--
-- @since 0.1.0.0
rSelect :: Signal Bool -> Behavior a -> Behavior a -> Behavior a
rSelect condition left right = react "rSelect" condition $ \case
  True -> Run "left" left
  False -> Run "right" right

-- | One-sided interruption: runs @task@; whenever the condition becomes true, stops
-- it, runs @recovery@ to completion, and begins again.
--
-- > monitor (pure False) recovery task  =  task
--
-- The condition is read before anything starts. When it is true, that is latched:
-- the task is stopped, and when it has ended, cleanup included, @recovery@ runs to
-- completion while nothing watches the condition, even if it has become false by
-- then. After that it is read afresh; the task restarts from its beginning.
--
-- [Result] That of the task, also if it was asked to stop and completed all the
--   same; then the recovery does not run.
-- [Failure] Of the task or the recovery: ends the operator with it. If the task
--   fails /while it is being stopped/, the recovery runs first: a cleanup that goes
--   wrong must not keep the robot from its charger. A condition that fails, or
--   that has no value any more, is not \"false\": the task is stopped and the
--   operator fails.
-- [Fault] Likewise.
-- [Cancellation] Only the caller can interrupt the recovery; so an outer 'monitor'
--   outranks an inner one. All is asked to stop at once; it returns after all has
--   ended.
--
-- >>> import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
-- >>> battery <- newTVarIO (5 :: Int)
-- >>> let recharge = putStrLn "recharge" >> atomically (writeTVar battery 100)
-- >>> Signal.monitor ((< 10) <$> Signal.watching (readTVar battery)) recharge (putStrLn "work")
-- recharge
-- work
--
-- /Definition 3.2 and Section 5 of the paper, with a signal for the condition./
--
-- @since 0.1.0.0
monitor :: Signal Bool -> Behavior () -> Behavior a -> Behavior a
monitor condition recovery task = react "monitor" condition $ \case
  True -> RunToEnd "recovery" recovery
  False -> Run "task" task

-- | 'rSelect' with a branch for each value of any type.
--
-- All that is said of 'rSelect' holds.
--
-- >>> Signal.switch (pure "dock") (\mode -> putStrLn ("in mode " ++ mode))
-- in mode dock
--
-- @since 0.1.0.0
switch :: Eq k => Signal k -> (k -> Behavior a) -> Behavior a
switch signal behavior = react "switch" signal (Run "branch" . behavior)

-- | Ordered rules: always runs the first behaviour whose condition holds; while
-- none holds, it waits.
--
-- When an earlier condition becomes true, or the rule's own becomes false, the
-- running behaviour is stopped, the conditions are read again, and the first that
-- holds then decides. All that is said of 'rSelect' holds.
--
-- >>> Signal.teleoReactive [(pure False, pure "flee"), (pure True, pure "graze")]
-- "graze"
--
-- /After Nilsson's teleo-reactive programs; Section 3.4 of the paper names them./
--
-- @since 0.1.0.0
teleoReactive :: [(Signal Bool, Behavior a)] -> Behavior a
teleoReactive rules = react "teleoReactive" firstHolding $ \case
  Nothing -> Idle
  Just n -> Run ("rule " ++ show (n + 1)) (snd (rules !! n))
 where
  firstHolding = findIndex id <$> traverse (suppressEqual . fst) rules

-- | Waits until the condition holds; returns at once if it does.
--
-- A condition that fails, faults or has lost its value makes it throw the same.
--
-- >>> Signal.waitUntil (pure True)
--
-- @since 0.1.0.0
waitUntil :: Signal Bool -> Behavior ()
waitUntil condition = react "waitUntil" condition $ \case
  True -> Conclude (pure ())
  False -> Idle

-- | Runs the behaviour while the condition holds, and fails when it does not, at
-- the start or later.
--
-- [Result] The behaviour's, also if it was asked to stop and completed all the
--   same.
-- [Failure] When the condition does not hold: 'Behavior.FailedBecause' says so. The
--   behaviour's own failure, also while it is being stopped, is thrown instead.
-- [Fault] Of the behaviour or the condition, also while stopping: thrown.
-- [Cancellation] All is asked to stop at once; it returns after all has ended.
--
-- >>> Signal.whileHolding (pure False) (putStrLn "grip") ? putStrLn "lost it"
-- lost it
--
-- @since 0.1.0.0
whileHolding :: Signal Bool -> Behavior a -> Behavior a
whileHolding condition behavior = react "whileHolding" condition $ \case
  True -> Run "branch" behavior
  False -> Conclude (failWith "the condition does not hold")
