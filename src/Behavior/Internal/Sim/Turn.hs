{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Whose turn it is.
--
-- A task can use the turn if its next operation can be done, or if it receives what was
-- thrown to it. Time moves when no task can do anything.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Turn
  ( choose
  , waitings
  ) where

import Control.Monad (void, when)
import Data.IORef
import qualified Data.IntMap.Strict as IntMap
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust, isNothing)

import Behavior.Internal.Seconds (Seconds (..))
import Behavior.Internal.Sim.Enabled
import Behavior.Internal.Sim.OsSleep
import Behavior.Internal.Sim.Pending
import Behavior.Internal.Sim.Policy
import Behavior.Internal.Sim.State
import Behavior.Internal.Sim.Types
import Behavior.Internal.Simulator

-- | Who is next. Nobody when the run has ended by this; then the driver has the turn.
choose :: Sim -> Maybe Task -> IO (Maybe Task)
choose sim me = do
  able <- enabled sim
  n <- readIORef (counter sim)
  moved <- readIORef (movedAt sim)
  rotating <- (n >=) <$> readIORef (rotateAt sim)
  case Map.lookupMin able of
    Nothing -> timeMoves sim >>= \hope -> if hope then choose sim me else pure Nothing
    _ | n - moved > livelockLimit (options sim) -> finishing (Livelock (map taskLabel (Map.elems able)))
    Just (first, only)
      | Map.size able == 1 -> run n rotating only
      | otherwise -> do
          let goesOn = Map.member mine able && not rotating
              usually
                | goesOn = mine
                | otherwise = maybe first fst (Map.lookupGT mine able)
          decision <- decided sim n usually goesOn able
          case decision of
            Nothing -> pure Nothing
            Just task -> do
              when (goesOn && not (isMe task)) (detail sim IsPreempted)
              run n rotating task
 where
  mine = maybe (-1) taskNumber me
  isMe task = taskNumber task == mine
  finishing end = Nothing <$ conclude sim (Just end)

  run n rotating task = do
    unfile sim task
    when (rotating || not (isMe task)) (writeIORef (rotateAt sim) $! n + turns)
    ask <- askAt (chooser sim)
    rotate <- readIORef (rotateAt sim)
    writeIORef (askingAt sim) $! min ask rotate
    if isJust (taskThread task) then pure (Just task) else carry task

  -- A messenger only throws; then somebody else is next.
  carry messenger = do
    modifyIORef' (tasks sim) (IntMap.delete (taskNumber messenger))
    readIORef (place messenger) >>= \case
      Before _ (Throwing target e) -> void (throwAt sim Nothing target e)
      _ -> pure ()
    _ <- tick sim
    choose sim me

-- | Asks the policy for one of these tasks. Nothing: the run has ended by this.
decided :: Sim -> Int -> Int -> Bool -> Map Int Task -> IO (Maybe Task)
decided sim n usually goesOn able = do
  chosen <-
    decide (chooser sim) $
      Decision
        { decisionPoint = n
        , usual = usually
        , canGoOn = goesOn
        , candidates = Map.keys able
        , candidateCount = Map.size able
        , candidateAt = \k -> fst (Map.elemAt k able)
        }
  case chosen >>= \k -> maybe (Left "no such thread") Right (Map.lookup k able) of
    Left why -> Nothing <$ conclude sim (Just (ScheduleMismatch why))
    Right task -> do
      when (taskNumber task /= usually) (modifyIORef' (taken sim) ((n, taskNumber task) :))
      pure (Just task)

-- | No task can do anything: time moves on to when one can, and this is true; or the run
-- has ended.
timeMoves :: Sim -> IO Bool
timeMoves sim = do
  asleep <- readIORef (sleepers sim)
  case Map.lookupMin asleep of
    Just ((next, _), _) | not (infinite next), next <= end -> later asleep next >>= maybe (pure False) moveTo
    _
      | not (infinite end) -> do
          modifyIORef' (time sim) (max end)
          finishing OutOfTime
      | otherwise -> do
          disturbed <- meddled (5 :: Int)
          who' <- waitings sim (const True)
          finishing (if disturbed then ExternalWakeup who' else Deadlock who')
 where
  end = endAt (options sim)
  infinite (Seconds s) = isInfinite s
  finishing how = False <$ conclude sim (Just how)
  moveTo t = do
    writeIORef (time sim) $! t
    readIORef (counter sim) >>= writeIORef (movedAt sim)
    True <$ wakeUntil sim t

  -- Nothing in the simulation can wake anybody. Something outside might just have: a
  -- thread of the user's own.
  meddled 0 = pure False
  meddled n = do
    committed sim
    able <- enabled sim
    if Map.null able then osSleep 1000 >> meddled (n - 1) else pure True

  -- How far it moves: to the next moment at which a sleeper is due, or to a later one, as
  -- long as none is late by 'slip'.
  later asleep next = case (Map.toAscList within, Map.lookupMin within) of
    (_ : _ : _, Just (usually, _)) -> do
      n <- readIORef (counter sim)
      chosen <- decided sim n usually False (snd <$> within)
      _ <- tick sim
      pure (chosen >>= \task -> fst <$> Map.lookup (taskNumber task) within)
    _ -> pure (Just next)
   where
    -- One sleeper stands for all that are due at the same moment.
    within = Map.fromList [(k, (t, task)) | (t, (k, task)) <- Map.toList firsts]
    firsts = Map.fromListWith (\_ old -> old) [(t, (k, task)) | ((t, k), task) <- inReach]
    inReach
      | slip (options sim) > 0 =
          Map.toAscList (Map.takeWhileAntitone (\(t, _) -> t < next + slip (options sim) && t <= end) asleep)
      | otherwise = []

-- | Who of these tasks waits for what.
waitings :: Sim -> (Task -> Bool) -> IO [Waiting]
waitings sim these = do
  alive <- IntMap.elems <$> readIORef (tasks sim)
  waiting <- traverse (\task -> Waiting (taskLabel task) . reason alive task <$> readIORef (place task)) (filter these alive)
  (waiting ++) . concat <$> traverse sent alive
 where
  sent target = do
    all' <- readIORef (pending target)
    pure [Waiting (Label "interrupt" "messenger") (toReceive target) | p <- all', isNothing (sender p)]
  toReceive target = show (taskLabel target) ++ ", to hear an exception"
  reason alive task = \case
    Before _ (Transaction _ _) -> case [show (taskLabel t) | t <- alive, parent t == taskNumber task, isJust (taskThread t)] of
      [] -> "a transaction"
      branches -> "its branches: " ++ commas branches
    Before _ (Moment _) -> "the end of time"
    Before _ (Delivery target _) -> toReceive target
    _ -> "its turn"
  commas = foldr1 (\a b -> a ++ ", " ++ b)
