{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The paper's reactive operators: those of "Behavior.Internal.Reactive.Operators", on a
-- condition that is polled.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Reactive.Polled
  ( rSelect
  , monitor
  ) where

import Behavior.Internal.Core.Failure (Behavior)
import qualified Behavior.Internal.Reactive.Operators as Signal
import Behavior.Internal.Seam.Runtime (Seconds)
import qualified Behavior.Internal.Signal.Polling as Signal

-- | A reactive @if@: reads @test@ repeatedly, runs @left@ while it is true and
-- @right@ while it is false, and changes from one to the other whenever it changes.
--
-- > rSelect (pure True) left right  =  left
-- > rSelect test left right         =  Signal.rSelect (Signal.polling 0.01 test) left right
--
-- @left@ and @right@ never run at the same time: one has ended, cleanup
-- included, before the other starts. @test@ runs in its own thread, one reading
-- at a time, and readings start at least 10 ms apart.
--
-- [Result] That of the branch that completed.
-- [Failure] Of a branch or the test: ends the operator with it. A test that fails
--   is not \"false\".
-- [Fault] Likewise.
-- [Cancellation] Requests the stop of the branch and the test together; returns after both
--   have ended.
--
-- >>> rSelect (pure False) (putStrLn "turn") (putStrLn "move forward")
-- move forward
--
-- The documentation of 'Behavior.Signal.rSelect' has the details. That operator reacts at
-- once to conditions that need no polling.
--
-- /Definition 3.1 and Section 5 of the paper./
--
-- @since 0.1.0.0
rSelect :: Behavior Bool -> Behavior a -> Behavior a -> Behavior a
rSelect test = Signal.rSelect (Signal.polling defaultPeriod test)

-- | One-sided interruption: runs @task@ and reads @test@ repeatedly; whenever
-- it is true, stops the task, runs @recovery@ to completion, and begins again.
--
-- > monitor (pure False) recovery task  =  task
-- > monitor test recovery task          =  Signal.monitor (Signal.polling 0.01 test) recovery task
--
-- The recovery starts after the task has ended, cleanup included; @test@ is not read
-- while it runs, and only the caller can interrupt it. @test@ runs in its own
-- thread, one reading at a time, and readings start at least 10 ms apart.
--
-- [Result] That of the task. If the task completes although its stop was requested, it has
--   completed, and no recovery runs.
-- [Failure] Of the task, the recovery or the test: ends the operator with it. A
--   test that fails is not \"false\". If the task fails while it is being stopped,
--   the recovery runs first.
-- [Fault] Likewise.
-- [Cancellation] Requests the stop of everything together; returns after everything has ended.
--
-- >>> import Data.IORef
-- >>> battery <- newIORef (5 :: Int)
-- >>> let recharge = putStrLn "recharge" >> writeIORef battery 100
-- >>> monitor ((< 10) <$> readIORef battery) recharge (putStrLn "perform the task")
-- recharge
-- perform the task
--
-- The documentation of 'Behavior.Signal.monitor' has the details. That operator reacts at
-- once to conditions that need no polling.
--
-- /Definition 3.2 and Section 5 of the paper./
--
-- @since 0.1.0.0
monitor :: Behavior Bool -> Behavior () -> Behavior a -> Behavior a
monitor test = Signal.monitor (Signal.polling defaultPeriod test)

-- | How often 'rSelect' and 'monitor' read their test: every 10 ms.
defaultPeriod :: Seconds
defaultPeriod = 0.01
