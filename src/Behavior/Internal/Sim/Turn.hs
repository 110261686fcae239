{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Which task gets the turn.
--
-- A task is enabled if its next operation can be done, or if there is an exception that it can
-- receive. The virtual time advances when no task is enabled.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Turn
  ( choose
  , waitingTasks
  ) where

import Control.Monad (unless, void, when)
import Data.IORef
import qualified Data.IntMap.Strict as IntMap
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust, isNothing)

import Behavior.Internal.Core.Backend
import Behavior.Internal.Core.OsSleep
import Behavior.Internal.Core.Seconds (Seconds (..))
import Behavior.Internal.Sim.Circle
import Behavior.Internal.Sim.Enabled
import Behavior.Internal.Sim.Pending
import Behavior.Internal.Sim.Policy
import Behavior.Internal.Sim.State
import Behavior.Internal.Sim.Types
import Behavior.Internal.Spans.Place (Place (path), inPath, placeOf)

-- | The task that runs next. 'Nothing': the run has ended here, and the driver has the turn.
choose :: Sim -> Maybe Task -> IO (Maybe Task)
choose sim me = do
  enabledTasks <- enabled sim
  n <- readIORef (counter sim)
  moved <- readIORef (timeMovedAt sim)
  rotating <- (n >=) <$> readIORef (rotateAt sim)
  case Map.lookupMin enabledTasks of
    Nothing -> advanceTime sim >>= \advanced -> if advanced then choose sim me else pure Nothing
    _ | n - moved > livelockLimit (options sim) -> do
      repeated <- circles (livelockLimit (options sim)) <$> readIORef (time sim) <*> readIORef (emitted sim)
      endWith (Livelock (map taskLabel (Map.elems enabledTasks)) repeated)
    Just (first, only)
      | Map.size enabledTasks == 1 -> run n rotating only
      | otherwise -> do
          let mayGoOn = Map.member mine enabledTasks && not rotating
              usualChoice
                | mayGoOn = mine
                | otherwise = maybe first fst (Map.lookupGT mine enabledTasks)
          decision <- decided sim n usualChoice mayGoOn enabledTasks
          case decision of
            Nothing -> pure Nothing
            Just task -> do
              when (mayGoOn && not (isMe task)) (recordDetail sim IsPreempted)
              run n rotating task
 where
  mine = maybe (-1) taskNumber me
  isMe task = taskNumber task == mine
  endWith end = Nothing <$ endRun sim (Just end)

  run n rotating task = do
    unfile sim task
    when (rotating || not (isMe task)) (writeIORef (rotateAt sim) $! n + turnLimit)
    decision <- askAt (policyOf sim)
    rotate <- readIORef (rotateAt sim)
    writeIORef (nextDecisionAt sim) $! min decision rotate
    if isJust (taskThread task) then pure (Just task) else throwNow task

  -- A helper task only throws; then another task gets the turn.
  throwNow helper = do
    modifyIORef' (tasks sim) (IntMap.delete (taskNumber helper))
    readIORef (blockedAt helper) >>= \case
      Before _ (Throwing target e) -> void (throwAt sim Nothing target e)
      _ -> pure ()
    _ <- tick sim
    choose sim me

-- | Lets the policy choose one of these tasks. 'Nothing': the run has ended here.
decided :: Sim -> Int -> Int -> Bool -> Map Int Task -> IO (Maybe Task)
decided sim n usualChoice mayGoOn enabledTasks = do
  chosen <-
    decide (policyOf sim) $
      Decision
        { decisionPoint = n
        , usual = usualChoice
        , canGoOn = mayGoOn
        , candidates = Map.keys enabledTasks
        , candidateCount = Map.size enabledTasks
        , candidateAt = \k -> fst (Map.elemAt k enabledTasks)
        }
  case chosen >>= \k -> maybe (Left "no such thread") Right (Map.lookup k enabledTasks) of
    Left why -> Nothing <$ endRun sim (Just (ScheduleMismatch why))
    Right task -> do
      when (taskNumber task /= usualChoice) (modifyIORef' (deviations sim) ((n, taskNumber task) :))
      pure (Just task)

-- | No task is enabled: either advances the virtual time to the next moment at which one is,
-- and returns 'True'; or ends the run.
advanceTime :: Sim -> IO Bool
advanceTime sim = do
  asleep <- readIORef (sleepers sim)
  case Map.lookupMin asleep of
    Just ((next, _), _)
      | not (infinite next), next <= end -> later asleep next >>= maybe (pure False) moveTo
      | not (infinite next) -> atEnd OutOfTime
    _ -> do
      woken <- wokenFromOutside (5 :: Int)
      atEnd (if woken then ExternalWakeup else Deadlock)
 where
  atEnd how = do
    waiting <- waitingTasks sim (const True)
    unless (infinite end) (modifyIORef' (time sim) (max end))
    endWith (how waiting)
  end = endAt (options sim)
  infinite (Seconds s) = isInfinite s
  endWith how = False <$ endRun sim (Just how)
  moveTo t = do
    writeIORef (time sim) $! t
    readIORef (counter sim) >>= writeIORef (timeMovedAt sim)
    True <$ wakeUntil sim t

  -- No task can enable another. A thread outside of the simulation, started by the user, may
  -- just have enabled one.
  wokenFromOutside 0 = pure False
  wokenFromOutside n = do
    committed sim
    enabledTasks <- enabled sim
    if Map.null enabledTasks then osSleep 1000 >> wokenFromOutside (n - 1) else pure True

  -- The new time: the next moment at which a sleeper is due, or a later such moment that is
  -- less than 'timerSlip' after it.
  later asleep next = case (Map.toAscList within, Map.lookupMin within) of
    (_ : _ : _, Just (usualChoice, _)) -> do
      n <- readIORef (counter sim)
      chosen <- decided sim n usualChoice False (snd <$> within)
      _ <- tick sim
      pure (chosen >>= \task -> fst <$> Map.lookup (taskNumber task) within)
    _ -> pure (Just next)
   where
    -- One sleeper represents all that are due at the same moment.
    within = Map.fromList [(k, (t, task)) | (t, (k, task)) <- Map.toList firsts]
    firsts = Map.fromListWith (\_ old -> old) [(t, (k, task)) | ((t, k), task) <- inReach]
    inReach
      | timerSlip (options sim) > 0 =
          Map.toAscList (Map.takeWhileAntitone (\(t, _) -> t < next + timerSlip (options sim) && t <= end) asleep)
      | otherwise = []

-- | What each of these tasks waits for.
waitingTasks :: Sim -> (Task -> Bool) -> IO [Waiting]
waitingTasks sim these = do
  alive <- IntMap.elems <$> readIORef (tasks sim)
  waiting <- traverse (waitingTask alive) (filter these alive)
  (waiting ++) . concat <$> traverse sent alive
 where
  waitingTask alive task = do
    here <- maybe (pure Nothing) placeOf (taskThread task)
    what <- reason alive task <$> readIORef (blockedAt task)
    pure (Waiting (taskLabel task) (what ++ inPath (maybe [] path here)))
  sent target = do
    late <- readIORef (pending target)
    pure [Waiting (Label "interrupt" "helper") (toReceive target) | p <- late, isNothing (sender p)]
  toReceive target = show (taskLabel target) ++ " to receive an exception"
  reason alive task = \case
    Before _ (Transaction _ _) ->
      case [show (taskLabel t) | t <- alive, parent t == taskNumber task, isJust (taskThread t)] of
        [] -> "a transaction"
        branches -> "a transaction (its branches: " ++ commas branches ++ ")"
    Before _ (Moment _) -> "the end of its sleep"
    Before _ (Delivery target _) -> toReceive target
    _ -> "its turn"
  commas = foldr1 (\a b -> a ++ ", " ++ b)
