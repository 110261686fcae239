{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Making a behaviour wait while a condition holds.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Reactive.Pausing
  ( pausedWhile
  , stoppedWhile
  ) where

import Control.Concurrent.STM (check, newTVarIO, readTVar, writeTVar)
import Control.Exception (mask_, throwIO, try)
import Control.Monad (unless)

import Behavior.Internal.Concurrent.Outcome (Outcome (..), outcomeToIO)
import Behavior.Internal.Concurrent.Repeating (sleepForever)
import Behavior.Internal.Concurrent.Scope
import Behavior.Internal.Core.Cause (Cause (..))
import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Core.Stop (causeOf)
import Behavior.Internal.Reactive.Engine
import Behavior.Internal.Seam.Runtime (awaitUninterruptibly)
import Behavior.Internal.Signal.Source

-- $setup
-- >>> import Behavior
-- >>> import Behavior.STM
-- >>> import Behavior.Sim (simulate)
-- >>> import qualified Behavior.Signal as Signal

-- | Pauses a behaviour while a condition holds, if its driver can do that: the behaviour is not stopped,
-- and goes on where it was.
--
-- > pausedWhile (pure False) pause resume act  =  act
-- > pausedWhile c pause resume act  =  act ||| stoppedWhile (not \<$> c) ((pause >> sleepForever) `finally` resume)
-- >   -- if c is false at first, act has no result, pause stops when it should, and nothing throws
--
-- The condition is read before anything starts, and while it holds, @act@ does not begin. Later, whenever
-- it becomes true, @pause@ runs beside @act@; and when it has become false again, @resume@. For a
-- behaviour that cannot be paused, there is 'stoppedWhile': it stops the behaviour, and begins it again.
--
-- Once @pause@ has begun, @resume@ is certain to run, whatever happens: if @act@ ends meanwhile, if
-- the caller is cancelled, or if @pause@ itself fails or completes late. If the condition is false again
-- before @pause@ has ended, @pause@ is stopped, perhaps before it had an effect: so @resume@ must do no
-- harm when nothing is paused. Nothing interrupts @resume@, and everything waits for it: if it takes time,
-- limit it (@'Behavior.Time.timeout' 1 resume@). @pause@ and @resume@ never run at the same time.
--
-- [Result] That of @act@, also if it completed although its stop was requested.
-- [Failure] Of @act@, also while it is being stopped: thrown. Of @pause@ (also while it is being stopped), or
--   else of @resume@, or of the condition: @act@ is stopped, and the failure is thrown; after the end of @act@
--   it is ignored.
-- [Fault] Of any of them, also while stopping: thrown, whatever else has failed.
-- [Cancellation] Requests the stop of everything together. So @resume@ runs beside the cleanup of
--   @act@, and neither waits for the other. (A driver that is resumed while its goal is being cancelled must
--   not begin to move.)
--
-- >>> near <- newTVarIO False
-- >>> paused <- newTVarIO False
-- >>> let step name = atomically (readTVar paused >>= check . not) >> sleep 1 >> putStrLn name
-- >>> let setPaused to = putStrLn (if to then "pause" else "resume") >> atomically (writeTVar paused to)
-- >>> let person = sleep 1.5 >> atomically (writeTVar near True) >> sleep 5 >> atomically (writeTVar near False)
-- >>> let steps = mapM_ step ["one", "two", "three"]
-- >>> let work = Signal.pausedWhile (Signal.watching (readTVar near)) (setPaused True) (setPaused False) steps
-- >>> _ <- simulate (both person work)
-- one
-- pause
-- two
-- resume
-- three
--
-- @since 0.1.0.0
pausedWhile :: Signal Bool -> Behavior () -> Behavior () -> Behavior a -> Behavior a
pausedWhile condition pause resume act = react "pausedWhile" [()] beginning $ \() -> Run "branch" act
 where
  -- This signal has a value from the moment when the condition is false for the first time. Its worker, before
  -- that moment and after it, is the operator that runs the pauses.
  beginning = Signal $ \_ -> do
    begun <- newTVarIO False
    pure
      (fromView (pure (constantView (readTVar begun >>= check))))
        { workers = [Worker "pauses" (pure (\_ -> pauses begun))]
        }
  pauses begun = react "pausedWhile" [Just True] (phases begun) $ \case
    Just True -> Run "pause" (pauseThenResume pause resume)
    _ -> Idle
  phases begun = Signal $ \_ -> do
    source <- open (suppressEqual (unlessNamed "condition" condition)) everyValue
    pure source {view = mapView (>>= phase begun) <$> view source}
  -- Nothing before the beginning.
  phase begun holds = do
    is <- readTVar begun
    unless (is || holds) (writeTVar begun True)
    pure (if is || not holds then Just holds else Nothing)

-- | Pauses; when its own stop is requested, or pausing has failed, resumes. It receives a stop request only
-- before it resumes, and the request does not replace what pausing or resuming throws.
pauseThenResume :: Behavior () -> Behavior () -> Behavior ()
pauseThenResume pause resume = mask_ . structured "pausedWhile" $ \scope -> do
  pausing <- branch scope "pause" pause
  stopped <-
    try $
      awaitOutcome pausing >>= \case
        Completed () -> sleepForever
        _ -> pure ()
  let cause = either causeOf (\() -> SiblingFailed "pause") stopped
  requestStopAsync cause [SomeBranch pausing]
  paused <- awaitUninterruptibly (awaitOutcome pausing)
  resumed <- branch scope "resume" resume >>= awaitUninterruptibly . awaitOutcome
  pure . Verdict cause $ do
    case paused of
      FailedWith e -> throwIO e
      _ -> pure ()
    outcomeToIO resumed
    either throwIO pure stopped

-- | Runs a behaviour only while a condition does not hold: when it becomes true, the behaviour is
-- stopped; when it is false again, the behaviour begins again, from its beginning.
--
-- > stoppedWhile c act  =  teleoReactive [(not \<$> c, act)]
--
-- If the driver can pause, use 'pausedWhile' instead. For a behaviour that keeps its progress, and so goes on
-- where it was, there is 'Behavior.resumable'.
--
-- > Signal.stoppedWhile personNear (resumable waypoints driveTo)
--
-- Everything that is documented for 'Behavior.Signal.rSelect' holds here too. While the condition
-- holds, this operator waits. To fail instead, use 'Behavior.Signal.whileHolding'.
--
-- >>> near <- newTVarIO False
-- >>> left <- newTVarIO ["gate", "pond", "shed"]
-- >>> let visit place = putStrLn ("to the " ++ place) >> sleep 2
-- >>> let person = sleep 3 >> atomically (writeTVar near True) >> sleep 5 >> atomically (writeTVar near False)
-- >>> _ <- simulate (both person (Signal.stoppedWhile (Signal.watching (readTVar near)) (resumable left visit)))
-- to the gate
-- to the pond
-- to the pond
-- to the shed
--
-- @since 0.1.0.0
stoppedWhile :: Signal Bool -> Behavior a -> Behavior a
stoppedWhile condition act = reactToCondition "stoppedWhile" condition $ \case
  True -> Idle
  False -> Run "branch" act
