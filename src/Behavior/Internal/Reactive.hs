{-# LANGUAGE LambdaCase #-}

-- |
-- The reactive engine, and the operators that are a few lines on it.
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

import Control.Concurrent.STM (STM, check)
import Control.Exception (SomeException, throwIO)
import Data.List (findIndex)

import Behavior.Internal.Failure (Behavior, catchSynchronous, failWith)
import Behavior.Internal.Runtime (Label (..), atomically, unlessAtAGlance)
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

-- | Runs what the reaction to the signal's value says, and switches when it says
-- something else.
react :: Eq k => String -> Signal k -> (k -> Reaction a) -> Behavior a
react name signal reacting = structured $ \within -> do
  opened <- open (distinct signal)
  begin Engine {operator = name, scope = within, source = opened, reaction = reacting} atFirst

-- | Starts the sensors, and looks in the given way.
begin :: Eq k => Engine k a -> (View k -> STM k) -> IO (IO a)
begin engine how = do
  (seen, sensors) <- startSensors (scope engine) (operator engine) (source engine)
  choose engine sensors seen how

-- | Nothing runs: reads, and does what the value says now.
choose :: Eq k => Engine k a -> Sensors -> View k -> (View k -> STM k) -> IO (IO a)
choose engine sensors seen how = atomically (attend sensors (how seen)) >>= obey engine sensors seen

obey :: Eq k => Engine k a -> Sensors -> View k -> Either SomeException k -> IO (IO a)
obey engine sensors seen = \case
  Left dead -> pure (throwIO dead)
  Right old -> case reaction engine old of
    Conclude verdict -> pure verdict
    RunToEnd name recovery -> do
      askWithoutWaiting (sensorBranches sensors)
      recover engine sensors name recovery Nothing
    Idle -> do
      awake <- goOn (scope engine) sensors
      observe (attend awake (changed old)) >>= obey engine awake seen
    Run name act -> do
      running <- branch (scope engine) (Label (operator engine) name) act
      -- The branch is looked at first: one that has ended by itself is not
      -- interrupted, whatever the signal says in the same transaction.
      unlessAtAGlance (fmap settle <$> outcomeNow running) $ do
        awake <- goOn (scope engine) sensors
        event <-
          observe $
            outcomeSoFar running
              >>= maybe (fmap Right <$> attend awake (changed old)) (pure . Right . Left)
        case event of
          Right (Left end) -> pure (settle end)
          Right (Right new) -> interrupt engine awake running (reaction engine new)
          Left dead -> interrupt engine awake running (Conclude (throwIO dead))
 where
  changed old = do
    new <- later seen
    check (new /= old)
    pure new

-- | What is to come comes if the branch stops as it is asked to. If it completes all
-- the same, it has completed, and that is the end.
interrupt :: Eq k => Engine k a -> Sensors -> Branch a -> Reaction a -> IO (IO a)
interrupt engine sensors running = \case
  Conclude verdict ->
    stopping (sensorBranches sensors) >>= \case
      Stopped _ -> pure verdict
      end -> pure (settle end)
  RunToEnd name recovery ->
    stopping (sensorBranches sensors) >>= \case
      Completed a -> pure (pure a)
      Stopped _ -> forget (scope engine) running >> recover engine sensors name recovery Nothing
      -- A cleanup that went wrong must not keep the robot from its charger.
      wrong -> recover engine sensors name recovery (Just (settle wrong))
  _ ->
    stopping [] >>= \case
      -- Read again: by now the value may be another, or the old one again.
      Stopped _ -> do
        forget (scope engine) running
        seen <- atomically (view (source engine))
        choose engine sensors seen later
      end -> pure (settle end)
 where
  stopping others = ask (SomeBranch running : others) >> ended running

-- | Runs the recovery to its end. The sensors were asked to stop: it does not wait for
-- those that are slow to, but what comes after it does.
recover :: Eq k => Engine k a -> Sensors -> String -> Behavior () -> Maybe (IO a) -> IO (IO a)
recover engine sensors name recovery aftermath = do
  recovered <- branch (scope engine) (Label (operator engine) name) recovery
  end <- ended recovered
  case (result end, aftermath) of
    (_, Just verdict) -> pure verdict
    (Left wrong, Nothing) -> pure (throwIO wrong)
    (Right (), Nothing) -> do
      forget (scope engine) recovered
      rested <- traverse (rest (scope engine)) (sensorBranches sensors)
      if and rested then begin engine later else pure (failWith "a sensor faulted")

-- | Looks at a value, and first at the sensors that it comes from.
attend :: Sensors -> STM a -> STM (Either SomeException a)
attend sensors value = lost sensors >>= maybe (Right <$> value) (pure . Left)

-- | Waits for a transaction; what it throws is a sensor's. (Not inlined: who waits is to keep
-- the transaction alone, and not a second time in a handler's closure.)
observe :: STM (Either SomeException a) -> IO (Either SomeException a)
observe transaction = atomically transaction `catchSynchronous` (pure . Left)
{-# NOINLINE observe #-}

-- | Waits until a branch that was asked to stop has ended. If it faulted it stays
-- in the scope, which throws its fault.
rest :: Scope -> SomeBranch -> IO Bool
rest within (SomeBranch sensor) =
  ended sensor >>= \case
    Faulted _ -> pure False
    _ -> True <$ forget within sensor

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
  firstHolding = findIndex id <$> traverse (distinct . fst) rules

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
