{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- The reactive operators: each is a few lines that use the reactive engine.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Reactive.Operators
  ( -- * Interrupting
    rSelect
  , monitor
  , insteadWhen

    -- * Many branches
  , switch
  , teleoReactive

    -- * Reading, waiting for a condition, and requiring one
  , read
  , waitUntil
  , waitUntilJust
  , whileHolding
  ) where

import Data.List (findIndex, intercalate, nub)
import Data.Maybe (isNothing)
import Prelude hiding (read)

import Behavior.Internal.Core.Failure (Behavior, failWith)
import Behavior.Internal.Reactive.Engine
import Behavior.Internal.Signal.Source

-- $setup
-- >>> import Behavior
-- >>> import Behavior.STM (atomically)
-- >>> import qualified Behavior.Signal as Signal

-- | A reactive @if@: runs @left@ while the condition is true and @right@ while it
-- is false, and changes from one to the other whenever the condition changes.
--
-- > rSelect (pure True) left right  =  left
-- > rSelect condition left right    =  switch condition (\c -> if c then left else right)
--
-- The condition is read before anything starts. When it changes, the running branch is
-- stopped; when that has ended, cleanup included, the condition is read again, and the
-- branch for its value starts (perhaps the same branch, from its beginning).
--
-- [Result] That of the branch that completed, also of one that completed although its stop
--   was requested.
-- [Failure] A branch that fails, also while it is being stopped, ends the
--   operator with its failure. A condition that fails, or that no longer has a
--   value, is not \"false\": the branch is stopped and the operator fails.
-- [Fault] Of a branch or the condition, also while stopping: thrown, after everything has
--   ended. Nothing else starts.
-- [Cancellation] Requests the stop of the branch and the sensors together; returns after
--   they have ended.
--
-- >>> Signal.rSelect (pure True) (pure "left") (pure "right")
-- "left"
--
-- /Definition 3.1 and Section 5 of the paper, with a signal for the condition./
--
-- @since 0.1.0.0
rSelect :: Signal Bool -> Behavior a -> Behavior a -> Behavior a
rSelect condition left right = reactToCondition "rSelect" condition $ \case
  True -> Run "left" left
  False -> Run "right" right

-- | One-sided interruption: runs @task@; whenever the condition becomes true, stops
-- the task, runs @recovery@ to completion, and begins again.
--
-- > monitor (pure False) recovery task  =  task
--
-- The condition is read before anything starts. When it is true, that is latched:
-- the task is stopped, and when it has ended, cleanup included, @recovery@ runs to
-- completion while the condition is not watched, even if it has become false by
-- then. After that the condition is read again, and the task restarts from its beginning. (To go on where
-- it was, use 'Behavior.resumable' in the task.)
--
-- [Result] That of the task, also if it completed although its stop was requested; then the
--   recovery does not run.
-- [Failure] Of the task or the recovery: ends the operator with it. If the task
--   fails /while it is being stopped/, the recovery runs first: a cleanup that
--   fails must not keep the robot from its charger. (If the recovery then fails, too, the
--   task's failure is thrown.) A condition that fails, or that no longer has a value, is not
--   \"false\": the task is stopped and the operator fails.
-- [Fault] Likewise.
-- [Cancellation] Only the caller can interrupt the recovery; so an outer 'monitor'
--   outranks an inner one. Requests the stop of everything together; returns after everything
--   has ended.
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
monitor condition recovery task = reactToCondition "monitor" condition $ \case
  True -> RunToEnd "recovery" (BeginAgain <$ recovery)
  False -> Run "task" task

-- | Runs @act@; when the condition becomes true, stops @act@, and runs @emergency@ in its place: once,
-- to completion, and with no way back.
--
-- > insteadWhen (pure False) emergency act  =  act
-- > insteadWhen (pure True)  emergency act  =  emergency
--
-- The condition is read before anything starts. When it is true, that is latched: @act@ is stopped,
-- and when it has ended, cleanup included, @emergency@ runs, and the condition is not watched any
-- more. (With @whileHolding (not \<$> condition) act ? emergency@ a failure of @act@ would start
-- the emergency too, and a fault in its cleanup would prevent it.)
--
-- [Result] That of @act@, also if it completed although its stop was requested (then the emergency
--   does not run), or of @emergency@.
-- [Failure] Of @act@ or @emergency@: ends the operator with it. If @act@ fails /while it is being
--   stopped/, the emergency runs first, and then that failure is thrown. A condition that fails, or
--   that no longer has a value, is not \"false\": @act@ is stopped and the operator fails.
-- [Fault] Likewise.
-- [Cancellation] Only the caller can interrupt the emergency. Requests the stop of everything
--   together; returns after everything has ended.
--
-- >>> import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
-- >>> windy <- newTVarIO False
-- >>> let survey = putStrLn "survey" >> atomically (writeTVar windy True) >> sleep 3600
-- >>> Signal.insteadWhen (Signal.watching (readTVar windy)) (putStrLn "land") survey
-- survey
-- land
--
-- @since 0.1.0.0
insteadWhen :: Signal Bool -> Behavior a -> Behavior a -> Behavior a
insteadWhen condition emergency act = reactToCondition "insteadWhen" condition $ \case
  True -> RunToEnd "emergency" (EndWith <$> emergency)
  False -> Run "branch" act

-- | 'rSelect' with a branch for each value of any type.
--
-- Everything that is documented for 'rSelect' holds here too. When the value changes and changes
-- back, the branch restarts. If a flicker must not restart it, use 'Behavior.Signal.debounce'; if it
-- must not restart at all, 'insteadWhen' or 'whileHolding'.
--
-- >>> Signal.switch (pure "dock") (\mode -> putStrLn ("in mode " ++ mode))
-- in mode dock
--
-- @since 0.1.0.0
switch :: Eq k => Signal k -> (k -> Behavior a) -> Behavior a
switch signal behavior = react "switch" [] signal (Run "branch" . behavior)

-- | Ordered rules: always runs the first behaviour whose condition holds; while
-- none holds, it waits.
--
-- When an earlier condition becomes true, or the rule's own becomes false, the
-- running behaviour is stopped, the conditions are read again, and the first one that
-- then holds decides. Everything that is documented for 'rSelect' holds here too.
--
-- A rule that returns ends 'teleoReactive', with its result. So a rule whose work is done when its condition
-- no longer holds must be a loop, or wait at its end: if its last step makes the condition false, it could
-- return before it is stopped. A rule that handles a driver's messages is 'Behavior.Message.messageRule'.
--
-- >>> Signal.teleoReactive [(pure False, pure "flee"), (pure True, pure "graze")]
-- "graze"
--
-- /After Nilsson's teleo-reactive programs; Section 3.4 of the paper names them./
--
-- @since 0.1.0.0
teleoReactive :: [(Signal Bool, Behavior a)] -> Behavior a
teleoReactive rules = react "teleoReactive" (map Just [0 .. length rules - 1]) firstHolding $ \case
  Nothing -> Idle
  Just n -> Run ("rule " ++ show (n + 1)) (snd (rules !! n))
 where
  firstHolding = dependingOnTrace $ \traced ->
    findIndex id <$> traverse (suppressEqual . fst) (if traced then zipWith numbered [1 ..] rules else rules)
  numbered n (condition, behavior) = (conditionOfRule n condition, behavior)

-- | Reads the signal once: the value that it has now, or its first one.
--
-- > read (pure a)       =  pure a
-- > read (watching t)   =  atomically t
-- > read (polling p a)  =  a     -- in a thread of its own
-- > read signal         =  waitUntilJust (Just \<$> signal)
--
-- [Result] The value. A signal that has none yet is waited for.
-- [Failure, fault] Of the signal: thrown.
-- [Cancellation] Requests the stop of the sensors; returns after they have ended.
--
-- >>> Signal.read ((+ 1) <$> Signal.polling 60 (pure 2))
-- 3
--
-- @since 0.1.0.0
read :: Signal a -> Behavior a
read = awaiting "read" . fmap Just

-- | Waits until the condition holds; returns at once if it does.
--
-- If the condition fails, faults or no longer has a value, it throws the same.
--
-- >>> Signal.waitUntil (pure True)
--
-- @since 0.1.0.0
waitUntil :: Signal Bool -> Behavior ()
waitUntil condition = reactToCondition "waitUntil" condition $ \case
  True -> Conclude Nothing (pure ())
  False -> Idle

-- | Waits until there is a value, and returns that first value. In everything else it is like 'waitUntil'.
--
-- > waitUntil c  =  waitUntilJust ((\holds -> if holds then Just () else Nothing) \<$> c)
--
-- >>> Signal.waitUntilJust (lookup "kitchen" <$> pure [("hall", 1), ("kitchen", 2)])
-- 2
--
-- @since 0.1.0.0
waitUntilJust :: Signal (Maybe a) -> Behavior a
waitUntilJust = awaiting "waitUntilJust"

awaiting :: String -> Signal (Maybe a) -> Behavior a
awaiting name signal = react name [] (Awaited <$> signal) $ \(Awaited value) ->
  maybe Idle (Conclude Nothing . pure) value

-- | A value that is waited for. The first one ends the wait, so two values are never compared.
newtype Awaited a = Awaited (Maybe a)

instance Eq (Awaited a) where
  Awaited a == Awaited b = isNothing a && isNothing b

-- | A guard: runs the behaviour while the condition holds, and fails if the condition does not
-- hold, at the start or later.
--
-- > whileHolding c act ? recovery     -- a guard with a recovery, which also runs when act fails
--
-- [Result] The behaviour's, also if it completed although its stop was requested.
-- [Failure] When the condition does not hold: a 'Behavior.FailedBecause' with that reason, and the
--   condition's name if it has one ('Behavior.Signal.named'). The behaviour's own failure, also
--   while it is being stopped, is thrown instead.
-- [Fault] Of the behaviour or the condition, also while stopping: thrown.
-- [Cancellation] Requests the stop of everything together; returns after everything has ended.
--
-- >>> let holds = Signal.named "gripper closed" (pure False)
-- >>> fallbackWith (Signal.whileHolding holds (putStrLn "carry")) print
-- FailedBecause "the condition does not hold: gripper closed"
--
-- @since 0.1.0.0
whileHolding :: Signal Bool -> Behavior a -> Behavior a
whileHolding condition behavior = react "whileHolding" [Nothing] (orReason condition) $ \case
  Nothing -> Run "branch" behavior
  Just reason -> Conclude Nothing (failWith reason)

-- | Nothing while the condition holds; otherwise the reason why a guard fails.
orReason :: Signal Bool -> Signal (Maybe String)
orReason condition = Signal $ \demand -> do
  source <- open (unlessNamed "condition" condition) (demand `contramapDemand` reason [])
  pure (reason (nub (names source)) <$> source)
 where
  reason _ True = Nothing
  reason these False =
    Just (intercalate ": " ("the condition does not hold" : [intercalate ", " these | not (null these)]))
