{-# LANGUAGE LambdaCase #-}

-- |
-- Whose turn it is.
--
-- A task can use the turn if its next operation can be done, or if what was thrown to it
-- has arrived. Time moves when no task can do anything.
module Behavior.Internal.Sim.Turn
  ( choose
  , possible
  , arriveAt
  ) where

import Control.Concurrent (threadDelay)
import Control.Exception
import Control.Monad (filterM, when)
import Data.IORef
import qualified Data.IntMap.Strict as IntMap
import Data.List (find)
import Data.Maybe (isJust)

import Behavior.Internal.Seconds (Seconds (..))
import Behavior.Internal.Sim.Policy
import Behavior.Internal.Sim.State
import Behavior.Internal.Sim.Types

-- | Who is next. Nobody when the run has ended by this; then the driver has the turn.
choose :: Sim -> Maybe Task -> IO (Maybe Task)
choose sim me = do
  alive <- IntMap.elems <$> readIORef (tasks sim)
  able <- filterM (enabled sim) alive
  n <- readIORef (counter sim)
  moved <- readIORef (movedAt sim)
  rotating <- (n >=) <$> readIORef (rotateAt sim)
  case able of
    [] -> nobody sim alive >>= \hope -> if hope then choose sim me else pure Nothing
    _ | n - moved > standstill (options sim) -> finishing (Standing (map taskLabel able))
    [only] -> run n rotating only
    first : _ -> do
      let goesOn = any isMe able && not rotating
          usually
            | goesOn = mine
            | otherwise = maybe (taskNumber first) taskNumber (find ((> mine) . taskNumber) able)
      decided <- decide (chooser sim) (Decision n usually goesOn (map taskNumber able))
      case decided >>= \chosen -> maybe (Left "no such thread") Right (find ((== chosen) . taskNumber) able) of
        Left why -> finishing (Unfit why)
        Right task -> do
          when (taskNumber task /= usually) (modifyIORef' (taken sim) ((n, taskNumber task) :))
          when (goesOn && not (isMe task)) (detail sim IsPreempted)
          run n rotating task
 where
  mine = maybe (-1) taskNumber me
  isMe task = taskNumber task == mine
  finishing verdict = Nothing <$ conclude sim verdict

  run n rotating task = do
    when (rotating || not (isMe task)) (writeIORef (rotateAt sim) $! n + turns)
    ask <- askAt (chooser sim)
    rotate <- readIORef (rotateAt sim)
    writeIORef (askingAt sim) $! min ask rotate
    if isJust (taskThread task) then pure (Just task) else carry task

  -- A messenger does its one errand at once; then somebody else is next.
  carry messenger = do
    readIORef (place messenger) >>= \case
      Before _ (Delivery target e) -> arriveAt target e
      _ -> pure ()
    modifyIORef' (tasks sim) (IntMap.delete (taskNumber messenger))
    _ <- tick sim
    choose sim me

-- | Whether the task could use the turn.
enabled :: Sim -> Task -> IO Bool
enabled sim task =
  readIORef (raised task) >>= \case
    Just _ -> pure True
    Nothing ->
      readIORef (place task) >>= \case
        Unstarted -> pure True
        Before _ op -> possible sim op
        Gone -> pure False

-- | Whether the operation can be done now.
possible :: Sim -> Operation -> IO Bool
possible sim = \case
  Free -> pure True
  Moment t -> (t <=) <$> readIORef (time sim)
  Delivery target _ -> hears sim target
  Transaction wouldRun look -> do
    Look looked was <- readIORef look
    n <- readIORef (commits sim)
    if looked == n
      then pure was
      else do
        is <- wouldRun
        is <$ writeIORef look (Look n is)

-- | Whether what is thrown to the task arrives now (also: whether it has ended).
hears :: Sim -> Task -> IO Bool
hears sim target =
  readIORef (raised target) >>= \case
    Just _ -> pure False
    Nothing ->
      readIORef (place target) >>= \case
        Unstarted -> pure True
        Gone -> pure True
        Before Unmasked _ -> pure True
        Before MaskedInterruptible op -> not <$> possible sim op
        Before MaskedUninterruptible _ -> pure False

-- | What was thrown to the task has arrived, if that has not ended.
arriveAt :: Task -> SomeException -> IO ()
arriveAt target e =
  readIORef (place target) >>= \case
    Gone -> pure ()
    _ -> writeIORef (raised target) (Just e)

-- | No task can do anything: time moves on to when one can, and this is true; or the run
-- has ended.
nobody :: Sim -> [Task] -> IO Bool
nobody sim alive = do
  moments <- concat <$> traverse wakes alive
  t <- readIORef (time sim)
  case filter (not . isInfinite . realToDouble) moments of
    [] -> do
      disturbed <- meddled
      who' <- waitings sim
      False <$ conclude sim (if disturbed then Tampered who' else Hopeless who')
    some
      | next > endAt (options sim) -> do
          writeIORef (time sim) $! max t (endAt (options sim))
          False <$ conclude sim Late
      | otherwise -> do
          writeIORef (time sim) $! next
          readIORef (counter sim) >>= writeIORef (movedAt sim)
          pure True
     where
      next = minimum some
 where
  realToDouble (Seconds d) = d
  wakes task =
    readIORef (place task) >>= \case
      Before _ (Moment t) -> pure [t]
      _ -> pure []
  -- Nothing in the simulation can wake anybody. Something outside might just have: a
  -- thread of the user's own.
  meddled = looking (5 :: Int)
  looking 0 = pure False
  looking n = do
    committed sim
    able <- or <$> traverse (enabled sim) alive
    if able then pure True else threadDelay 1000 >> looking (n - 1)

-- | Who waits for what.
waitings :: Sim -> IO [Waiting]
waitings sim = do
  alive <- IntMap.elems <$> readIORef (tasks sim)
  traverse (\task -> Waiting (taskLabel task) . reason alive task <$> readIORef (place task)) alive
 where
  reason alive task = \case
    Before _ (Transaction _ _) -> case [show (taskLabel t) | t <- alive, parent t == taskNumber task, isJust (taskThread t)] of
      [] -> "a transaction"
      branches -> "its branches: " ++ commas branches
    Before _ (Moment _) -> "the end of time"
    Before _ (Delivery target _) -> show (taskLabel target) ++ ", to hear an exception"
    _ -> "its turn"
  commas = foldr1 (\a b -> a ++ ", " ++ b)
