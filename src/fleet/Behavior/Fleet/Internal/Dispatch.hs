{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Tasks are started for all robots of a process that wait, and completed for all that are ready, by one statement each.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Dispatch
  ( newSeeker
  , nextStart
  , withdraw
  , dispatching
  , completed
  , isDone
  ) where

import Control.Concurrent (yield)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception (SomeException, allowInterrupt, onException, throwIO)
import Control.Monad (filterM, forever, replicateM_, unless, when, zipWithM)
import Data.Aeson (Value)
import Data.Foldable (for_)
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust)
import Data.Set (Set)
import qualified Data.Set as Set
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Behavior, Seconds, tryAny)
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Database
import Behavior.Fleet.Internal.Fleet
import Behavior.Fleet.Internal.Options
import Behavior.STM (atomically)

-- | A robot that is to wait for a task of this queue. It does not wait yet.
newSeeker :: Fleet -> Text -> Behavior Seeker
newSeeker fleet name = atomically $ do
  group <- groupOf fleet name (Set.fromList (map Text.pack (robotSkills it)))
  Seeker (Text.pack (robotName it)) group <$> newTVar False <*> newTVar (Just Nothing)
 where
  it = robot fleet

-- | From now on it waits.
seek :: Seeker -> STM ()
seek waiting = do
  before <- swapTVar (isSeeking waiting) True
  unless before $ do
    modifyTVar' (idle (seekerGroup waiting)) (waiting :)
    writeTVar (mayHave (seekerGroup waiting)) True

-- | Waits for a task: its start, and when it was asked for. To be called masked: nothing comes between the start and
-- its return. If it is interrupted, what was started for it is given back.
nextStart :: Fleet -> Seeker -> Behavior (Seconds, Start)
nextStart fleet waiting = do
  atomically (seek waiting)
  (allowInterrupt >> atomically ready) `onException` withdraw fleet waiting >>= either throwIO pure
 where
  ready = readTVar (handedOver waiting) >>= maybe retry pure >>= maybe retry pure

-- | It waits no more. What was started for it is given back.
withdraw :: Fleet -> Seeker -> Behavior ()
withdraw fleet waiting =
  atomically (swapTVar (handedOver waiting) Nothing) >>= \case
    Just (Just (Right (_, start))) -> giveBack fleet start
    _ -> pure ()

groupOf :: Fleet -> Text -> Set Text -> STM Group
groupOf fleet name which =
  readTVar (groups fleet) >>= maybe new pure . Map.lookup (name, which)
 where
  new = do
    group <- Group <$> newTVar [] <*> newTVar False
    group <$ modifyTVar' (groups fleet) (Map.insert (name, which) group)

giveBack :: Fleet -> Start -> Behavior ()
giveBack fleet start = posted fleet working (GiveBack (startTask start) (startLease start))

-- | Completes what is ready, and starts tasks for those that wait: by one statement, if there are both.
dispatching :: Fleet -> Behavior a
dispatching fleet = forever $ do
  (ready, seekers) <- atomically $ do
    ready <- reverse <$> swapTVar (completions fleet) []
    seekers <- (Just <$> nextGroup fleet) `orElse` pure Nothing
    (ready, seekers) <$ check (not (null ready) || isJust seekers)
  case seekers of
    Nothing -> complete fleet ready
    Just these | null ready -> claim fleet these
    Just these -> completeAndClaim fleet ready these

-- | The robots that wait for tasks of a queue.
type Seekers = ((Text, Set Text), Group, [Seeker])

completeAndClaim :: Fleet -> [Completion] -> Seekers -> Behavior ()
completeAndClaim fleet ready these@(_, group, waiting) = do
  wanted <- claiming fleet these
  answer <- answerTo fleet (CompleteAndClaim (map completion ready) wanted)
  case answer of
    -- (It may be a result that is refused, and then nothing was done.)
    Left _ -> do
      atomically $ modifyTVar' (idle group) (++ reverse waiting) >> writeTVar (mayHave group) True
      complete fleet ready
    Right (asked, (done, started)) -> do
      areCompleted fleet ready done
      areStarted fleet these (Right (asked, started))

claim :: Fleet -> Seekers -> Behavior ()
claim fleet these = claiming fleet these >>= answerTo fleet . Claim >>= areStarted fleet these

claiming :: Fleet -> Seekers -> Behavior Claiming
claiming fleet ((name, which), _, waiting) = do
  number <- newUnique (database fleet)
  pure (Claiming name (map seekerRobot waiting) which (taskTerm (options fleet)) number False)

-- | Hands out what was started; or throws that to those that wait.
areStarted :: Fleet -> Seekers -> Either SomeException (Seconds, [Start]) -> Behavior ()
areStarted fleet (_, group, waiting) answer = do
  unwanted <- atomically $ case answer of
    Left why -> [] <$ traverse (`handOver` Left why) waiting
    Right (asked, started) -> do
      let (served, others) = splitAt (length started) waiting
      mapM_ (seen fleet . startLease) started
      modifyTVar' (idle group) (++ reverse others)
      when (null others) $ writeTVar (mayHave group) True
      concat <$> zipWithM (\it start -> handOver it (Right (asked, start))) served started
  for_ unwanted (giveBack fleet)
  -- (First those that have a task run: what they do at once takes some steps, and is completed by one statement.)
  replicateM_ 6 yield

-- | What the database answers, and when it was asked. It waits for a database that is away.
answerTo :: Fleet -> Request r -> Behavior (Either SomeException (Seconds, r))
answerTo fleet what = (>>= granted) <$> tryAny (requestPatiently fleet working what)
 where
  granted (asked, given) = either (Left . refusedAs) (Right . (,) asked) given

-- | One in which robots wait, and for which there may be tasks, in turn; and those robots.
nextGroup :: Fleet -> STM Seekers
nextGroup fleet = do
  (before, after) <- Map.split <$> readTVar (lastGroup fleet) <*> readTVar (groups fleet)
  latest <- readTVar (lastGroup fleet)
  itself <- Map.lookup latest <$> readTVar (groups fleet)
  foldr (orElse . ready) retry (Map.toList after ++ Map.toList before ++ [(latest, group) | Just group <- [itself]])
 where
  ready (name, group) = do
    readTVar (mayHave group) >>= check
    everyone <- readTVar (idle group) >>= filterM (fmap isJust . readTVar . handedOver)
    check (not (null everyone))
    writeTVar (mayHave group) False
    let (first, others) = splitAt 64 (reverse everyone)
    writeTVar (idle group) (reverse others)
    (name, group, first) <$ writeTVar (lastGroup fleet) name

-- | Gives it to the robot; what it no longer waits for.
handOver :: Seeker -> Either SomeException (Seconds, Start) -> STM [Start]
handOver waiting what =
  readTVar (handedOver waiting) >>= \case
    Nothing -> pure [start | Right (_, start) <- [what]]
    Just _ -> [] <$ writeTVar (handedOver waiting) (Just (Just what))

-- | Whether the start is completed now, with this result. From now on the robot waits for the next one.
completed :: Fleet -> Seeker -> TaskNumber -> Number -> Value -> Behavior Bool
completed fleet next task lease gave = do
  how <- newTVarIO Nothing
  atomically (modifyTVar' (completions fleet) (Completion task lease gave how :) >> seek next)
  atomically (readTVar how >>= maybe retry pure) >>= either throwIO pure

complete :: Fleet -> [Completion] -> Behavior ()
complete fleet ready =
  answerTo fleet (Complete (map completion ready)) >>= \case
    -- (It is the result of one of them that is refused.)
    Left _ | _ : _ : _ <- ready -> mapM_ (complete fleet . pure) ready
    Left why -> atomically (for_ ready (\it -> writeTVar (isCompleted it) (Just (Left why))))
    Right (_, done) -> areCompleted fleet ready done

completion :: Completion -> (TaskNumber, Number, Value)
completion it = (completedTask it, completedLease it, completedResult it)

-- | Says to those that wait whether their starts are completed.
areCompleted :: Fleet -> [Completion] -> [(TaskNumber, Number)] -> Behavior ()
areCompleted fleet ready done = for_ ready $ \it -> do
  let start@(task, lease) = (completedTask it, completedLease it)
  -- (One that was completed before, and the answer was lost, is not completed now.)
  is <- if start `elem` done then pure (Right True) else tryAny (isDone fleet task lease)
  atomically (writeTVar (isCompleted it) (Just is))

-- | Whether this start has completed its task.
isDone :: Fleet -> TaskNumber -> Number -> Behavior Bool
isDone fleet task lease = (== Right IsCompleted) <$> request fleet working (Became task lease)
