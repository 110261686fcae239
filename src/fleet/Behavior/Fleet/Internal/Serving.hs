{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Serving a queue: one task after the other.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Serving
  ( serving
  , servingWith
  , Work (..)
  ) where

import Control.Exception
import Control.Monad (unless)
import Data.Aeson (FromJSON, ToJSON, Value, toJSON)
import Data.Maybe (isJust)
import qualified Data.Text as Text
import Data.Void (Void)

import Behavior (Behavior, BehaviorFailed (..), Failed (..), tryAny)
import Behavior.Fleet.Internal.Commit
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Database
import Behavior.Fleet.Internal.Dispatch
import Behavior.Fleet.Internal.Error
import Behavior.Fleet.Internal.Fleet
import Behavior.Fleet.Internal.Lease
import Behavior.Fleet.Internal.Line
import Behavior.Fleet.Internal.Options
import Behavior.Fleet.Internal.Task
import Behavior.STM (atomically)
import Behavior.Signal (insteadWhen, named, watching)
import Behavior.Time (timeout)
import qualified Behavior.Trace as Trace

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Fleet
-- >>> import Behavior.Fleet.Fake
-- >>> import Behavior.Parallel (firstOf)
-- >>> import Behavior.Sim (simulate, well)
-- >>> import Behavior.Time (now)
-- >>> import Data.Void (absurd)
-- >>> let orders = queue "orders" :: Queue String Int
-- >>> let inFleet act = simulate (newFakeDatabase >>= \db -> withFleet (fakeDatabase db) (Robot "amy" []) act) >>= well

-- | A start of a task, for the robot that does it.
--
-- @since 0.1.0.0
data Work i = Work
  { workKey :: String
  -- ^ The submitter's key. (Of a periodic task, and the time that it was due.)
  , workInput :: i
  , workStart :: Int
  -- ^ 1 at the first start.
  , reportProgress :: Value -> Behavior ()
  -- ^ Shows that to those who watch the task. Fails with 'NoDatabase'.
  }

-- | Serves a queue: starts one task after the other, when there are some that this robot is capable of, and waits when
-- there is none.
--
-- A task is /started at least once, and completed exactly once/. (One that fails at each of its starts is dead in the
-- end, and never completed.) The behaviour gives what is written, and the result: that is committed together with the
-- completion, or not at all. So whatever happens to a robot, its process or the database, what is written is there once
-- for each task that is done.
--
-- > serving fleet orders $ \order -> do
-- >   carry order
-- >   pure (writing (\connection -> void (execute connection "insert into delivered values (?)" (Only order))))
--
-- While the behaviour runs, the robot has a lease of the task, which is renewed. If it is lost (because the database
-- was away, or this process slept), or if the task is cancelled, the behaviour is stopped, and the next task is
-- started.
--
-- [Failure] Of the behaviour: that start has failed, and the next task is started. The failed one waits again after a
--   pause, or is dead ('pauses'). So it is with an input that is not of this type.
-- [Fault] Likewise, but then the fault is thrown: 'serving' ends. So it does with 'RestoredFromCopy' and 'WrongSchema'.
-- [Cancellation] Requests the stop of the behaviour. That start has failed, too.
--
-- >>> :{
-- inFleet $ \fleet -> do
--   ticket <- submit fleet orders "order 1" "a chair"
--   firstOf
--     [ absurd <$> serving fleet orders (\order -> sleep 5 >> pure (pure (length order)))
--     , (,) <$> waitForTask fleet ticket <*> now
--     ]
-- :}
-- (7,5.0)
--
-- @since 0.1.0.0
serving :: (FromJSON i, ToJSON o) => Fleet -> Queue i o -> (i -> Behavior (Commit o)) -> Behavior Void
serving fleet which behavior = servingWith fleet which (behavior . workInput)

-- | 'serving', for behaviours that need to know more of the task, or report progress.
--
-- A task that fails is started again:
--
-- >>> :{
-- inFleet $ \fleet -> do
--   ticket <- submit fleet orders "order 1" "a chair"
--   let carry work = if workStart work < 3 then failWith "it slips" else pure (pure 0)
--   firstOf [absurd <$> servingWith fleet orders carry, waitForTask fleet ticket >> now]
-- :}
-- 11.0
--
-- @since 0.1.0.0
servingWith :: (FromJSON i, ToJSON o) => Fleet -> Queue i o -> (Work i -> Behavior (Commit o)) -> Behavior Void
servingWith fleet which@(Queue name) behavior = mask $ \restore ->
  let serve waiting = do
        (asked, start) <- nextStart fleet waiting
        next <- newSeeker fleet name
        one asked start next `onException` withdraw fleet next
        serve next
      one asked start next = do
        let fails = failing fleet start
            lease = OfStart (startTask start) (startLease start)
        ended <-
          withLease (leases fleet) (ownClock (database fleet)) lease (taskTerm (options fleet)) asked $ \it ->
            tryAny (restore (underway fleet which next start it behavior))
              `onException` fails "its robot was stopped"
        case ended of
          Right Completed -> pure ()
          Right IsCancelled -> fails "cancelled"
          Right LostIt -> lost fleet start
          Left why -> do
            fails (reasonOf why)
            unless (isFailure why) (throwIO why)
   in newSeeker fleet name >>= serve

-- | How a start has ended, if its behaviour has neither failed nor faulted.
data Ending = Completed | IsCancelled | LostIt

underway
  :: (FromJSON i, ToJSON o)
  => Fleet -> Queue i o -> Seeker -> Start -> Lease -> (Work i -> Behavior (Commit o)) -> Behavior Ending
underway fleet (Queue name) next start lease behavior =
  Trace.named (Text.unpack name) . Trace.named (Text.unpack (startKey start)) $
    insteadWhen (named "lease lost or task cancelled" (watching ((/= Valid) <$> standing lease))) ending $ do
      input <- either notExpected pure (decoded (startInput start))
      wanted <- behavior (Work (Text.unpack (startKey start)) input (startCount start) progressing)
      hasCompleted <- completing fleet next start wanted
      pure (if hasCompleted then Completed else LostIt)
 where
  ending = atomically (standing lease) >>= \case
    LeaseIsLost -> pure LostIt
    _ -> pure IsCancelled
  -- (That is no fault of this robot's: someone has submitted it.)
  notExpected why = throwIO (NotAllowed ("its input is not what this robot expects: " ++ why))
  progressing what = request fleet working (Report (startTask start) (startLease start) what) >>= \case
    Left LeaseGone -> atomically (loses lease)
    answer -> granted answer

-- | Completes the task: whether this start is the one that has completed it.
completing :: ToJSON o => Fleet -> Seeker -> Start -> Commit o -> Behavior Bool
completing fleet next start = \case
  WritesNothing o -> evaluate (toJSON o) >>= completed fleet next task lease
  wanted -> committed (4 :: Int) wanted
 where
  (task, lease) = (startTask start, startLease start)
  committed tries wanted =
    try (withSession (working fleet) (\session -> commit session task lease toJSON wanted)) >>= \case
      Right (Right _) -> pure True
      Right (Left LeaseGone) -> pure False
      Right (Left Busy) -> again whyBusy
      Right (Left refusal) -> throwIO (refusedAs refusal)
      -- It is not known whether it was committed: so that is asked for.
      Left why ->
        request fleet working (Became task lease) >>= granted >>= \case
          IsCompleted -> pure True
          IsLost -> pure False
          StillRuns -> again (whyLost why)
   where
    again why = if tries > 1 then committed (tries - 1) wanted else throwIO (NotCommitted why)

-- | Says that this start has failed.
failing :: Fleet -> Start -> String -> Behavior ()
failing fleet start why = do
  atomically (report fleet (called start ++ " has failed: " ++ why))
  posted fleet working (Fail (startTask start) (startLease start) (Text.pack why))

-- | Reports that the lease is lost, unless the task was completed just before.
lost :: Fleet -> Start -> Behavior ()
lost fleet start = do
  became <- tryAny (timeout 1 (isDone fleet (startTask start) (startLease start)))
  case became of
    Right True -> pure ()
    _ -> atomically (report fleet (called start ++ ": its lease is lost"))

called :: Start -> String
called start = "the start " ++ show (startCount start) ++ " of the task " ++ show (startKey start)

-- | The text of what was thrown, without the names of what failed. (PostgreSQL has no character U+0000.)
reasonOf :: SomeException -> String
reasonOf why = [if c == '\0' then '\xfffd' else c | c <- maybe (textOf why) inner (fromException why)]
 where
  inner (BehaviorFailed _ e) = case fromException (toException e) of
    Just (FailedBecause text) -> text
    _ -> displayException e

isFailure :: SomeException -> Bool
isFailure why = isJust (fromException why :: Maybe BehaviorFailed)
