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

import Control.Concurrent.STM (check, newTVarIO, orElse, readTVar, writeTVar)
import Control.Exception (finally)
import Control.Monad (unless)

import Behavior.Internal.Failure (Behavior)
import Behavior.Internal.Reactive.Engine
import Behavior.Internal.Repeating (sleepForever)
import Behavior.Internal.Runtime (Label (..), atomically)
import Behavior.Internal.Scope
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
-- > pausedWhile c pause resume act  ~  act ||| switch c (\holds -> when holds (pause >> sleepForever) `finally` resume)
--
-- The condition is read before anything starts, and while it holds, @act@ does not begin. Later, whenever
-- it becomes true, @pause@ runs beside @act@; and when it has become false again, @resume@. What
-- cannot be paused, is stopped and begins again: 'stoppedWhile'.
--
-- That @resume@ runs is certain once @pause@ has begun, whatever happens: if @act@ ends meanwhile, if
-- the caller is cancelled, if @pause@ itself fails, or is no longer needed before it has ended (it is then
-- stopped, perhaps before it had an effect: to resume what is not paused must do no harm). It runs as a
-- cleanup does, with 'finally': if it takes time, limit it (@'Behavior.Time.cleanupWithin' 1 resume@). Of
-- @pause@ and @resume@ never two run at once.
--
-- [Result] That of @act@.
-- [Failure] Of @act@, @pause@ or @resume@, or of the condition: @act@ is stopped, and it is thrown. A
--   failure of @resume@ after the end of @act@ is ignored.
-- [Fault] Likewise, and none is ignored.
-- [Cancellation] Requests the stop of everything together. So @resume@ runs beside the cleanup of
--   @act@, which therefore need not wait for it; a driver must not begin to move because it is resumed
--   while its goal is being cancelled.
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
pausedWhile condition pause resume act = structured "pausedWhile" $ \scope -> do
  begun <- newTVarIO False
  let -- Nothing before the condition was false for the first time.
      phase holds = do
        is <- readTVar begun
        unless (is || holds) (writeTVar begun True)
        pure (if is || not holds then Just holds else Nothing)
      phases = Signal $ \_ -> do
        source <- open (suppressEqual (unlessNamed "condition" condition)) everyValue
        pure source {view = mapView (>>= phase) <$> view source}
      pausing = react "pausedWhile" phases $ \case
        Just True -> Run "pause" ((pause >> sleepForever) `finally` resume)
        _ -> Idle
  step <- branch scope (Label "pausedWhile" "branch") (atomically (readTVar begun >>= check) >> act)
  pauses <- branch scope (Label "pausedWhile" "pauses") pausing
  atomically ((endedBy "branch" <$> outcome step) `orElse` (endedBy "pauses" <$> outcome pauses))

-- | Runs a behaviour only while a condition does not hold: when it becomes true, the behaviour is
-- stopped; when it is false again, the behaviour begins again, from its beginning.
--
-- > stoppedWhile c act  =  teleoReactive [(not \<$> c, act)]
--
-- For what its driver can pause, there is 'pausedWhile'. To go on where it was, the behaviour keeps its
-- progress: 'Behavior.STM.resumable'.
--
-- > Signal.stoppedWhile personNear (resumable waypoints driveTo)
--
-- Everything that is documented for 'Behavior.Signal.rSelect' holds here too. While the condition
-- holds, it waits. To give up then, use 'Behavior.Signal.whileHolding'.
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
stoppedWhile condition act = react "stoppedWhile" (unlessNamed "condition" condition) $ \case
  True -> Idle
  False -> Run "branch" act
