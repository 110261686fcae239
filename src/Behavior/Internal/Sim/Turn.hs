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
  , waitingTasks
  ) where

import Control.Monad (void, when)
import Data.IORef
import qualified Data.IntMap.Strict as IntMap
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust, isNothing)

import Behavior.Internal.Runtime.Backend
import Behavior.Internal.Seconds (Seconds (..))
import Behavior.Internal.Sim.Enabled
import Behavior.Internal.Sim.OsSleep
import Behavior.Internal.Sim.Pending
import Behavior.Internal.Sim.Policy
import Behavior.Internal.Sim.State
import Behavior.Internal.Sim.Types

-- | Who is next. Nobody when the run has ended by this; then the driver has the turn.
choose :: Sim -> Maybe Task -> IO (Maybe Task)
choose sim me = do
  enabledTasks <- enabled sim
  n <- readIORef (counter sim)
  moved <- readIORef (timeMovedAt sim)
  rotating <- (n >=) <$> readIORef (rotateAt sim)
  case Map.lookupMin enabledTasks of
    Nothing -> timeMoves sim >>= \hope -> if hope then choose sim me else pure Nothing
    _ | n - moved > livelockLimit (options sim) -> endWith (Livelock (map taskLabel (Map.elems enabledTasks)))
    Just (first, only)
      | Map.size enabledTasks == 1 -> run n rotating only
      | otherwise -> do
          let goesOn = Map.member mine enabledTasks && not rotating
              usualChoice
                | goesOn = mine
                | otherwise = maybe first fst (Map.lookupGT mine enabledTasks)
          decision <- decided sim n usualChoice goesOn enabledTasks
          case decision of
            Nothing -> pure Nothing
            Just task -> do
              when (goesOn && not (isMe task)) (recordDetail sim IsPreempted)
              run n rotating task
 where
  mine = maybe (-1) taskNumber me
  isMe task = taskNumber task == mine
  endWith end = Nothing <$ endRun sim (Just end)

  run n rotating task = do
    unfile sim task
    when (rotating || not (isMe task)) (writeIORef (rotateAt sim) $! n + turnLimit)
    ask <- askAt (policyOf sim)
    rotate <- readIORef (rotateAt sim)
    writeIORef (nextDecisionAt sim) $! min ask rotate
    if isJust (taskThread task) then pure (Just task) else throwNow task

  -- A messenger only throws; then somebody else is next.
  throwNow messenger = do
    modifyIORef' (tasks sim) (IntMap.delete (taskNumber messenger))
    readIORef (blockedAt messenger) >>= \case
      Before _ (Throwing target e) -> void (throwAt sim Nothing target e)
      _ -> pure ()
    _ <- tick sim
    choose sim me

-- | Asks the policy for one of these tasks. Nothing: the run has ended by this.
decided :: Sim -> Int -> Int -> Bool -> Map Int Task -> IO (Maybe Task)
decided sim n usualChoice goesOn enabledTasks = do
  chosen <-
    decide (policyOf sim) $
      Decision
        { decisionPoint = n
        , usual = usualChoice
        , canGoOn = goesOn
        , candidates = Map.keys enabledTasks
        , candidateCount = Map.size enabledTasks
        , candidateAt = \k -> fst (Map.elemAt k enabledTasks)
        }
  case chosen >>= \k -> maybe (Left "no such thread") Right (Map.lookup k enabledTasks) of
    Left why -> Nothing <$ endRun sim (Just (ScheduleMismatch why))
    Right task -> do
      when (taskNumber task /= usualChoice) (modifyIORef' (deviations sim) ((n, taskNumber task) :))
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
          endWith OutOfTime
      | otherwise -> do
          disturbed <- wokenOutside (5 :: Int)
          who' <- waitingTasks sim (const True)
          endWith (if disturbed then ExternalWakeup who' else Deadlock who')
 where
  end = endAt (options sim)
  infinite (Seconds s) = isInfinite s
  endWith how = False <$ endRun sim (Just how)
  moveTo t = do
    writeIORef (time sim) $! t
    readIORef (counter sim) >>= writeIORef (timeMovedAt sim)
    True <$ wakeUntil sim t

  -- Nothing in the simulation can wake anybody. Something outside might just have: a
  -- thread of the user's own.
  wokenOutside 0 = pure False
  wokenOutside n = do
    committed sim
    enabledTasks <- enabled sim
    if Map.null enabledTasks then osSleep 1000 >> wokenOutside (n - 1) else pure True

  -- How far it moves: to the next moment at which a sleeper is due, or to a later one, as
  -- long as none is late by 'slip'.
  later asleep next = case (Map.toAscList within, Map.lookupMin within) of
    (_ : _ : _, Just (usualChoice, _)) -> do
      n <- readIORef (counter sim)
      chosen <- decided sim n usualChoice False (snd <$> within)
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
waitingTasks :: Sim -> (Task -> Bool) -> IO [Waiting]
waitingTasks sim these = do
  alive <- IntMap.elems <$> readIORef (tasks sim)
  waiting <- traverse (\task -> Waiting (taskLabel task) . reason alive task <$> readIORef (blockedAt task)) (filter these alive)
  (waiting ++) . concat <$> traverse sent alive
 where
  sent target = do
    all' <- readIORef (pending target)
    pure [Waiting (Label "interrupt" "helper") (toReceive target) | p <- all', isNothing (sender p)]
  toReceive target = show (taskLabel target) ++ ", to hear an exception"
  reason alive task = \case
    Before _ (Transaction _ _) -> case [show (taskLabel t) | t <- alive, parent t == taskNumber task, isJust (taskThread t)] of
      [] -> "a transaction"
      branches -> "its branches: " ++ commas branches
    Before _ (Moment _) -> "the end of time"
    Before _ (Delivery target _) -> toReceive target
    _ -> "its turn"
  commas = foldr1 (\a b -> a ++ ", " ++ b)
