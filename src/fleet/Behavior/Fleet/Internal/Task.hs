{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Tasks: submitted by some, served by others.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Task
  ( -- * Queues
    Queue (..)
  , queue

    -- * Submitting
  , submit
  , submitWith
  , SubmitOptions (..)
  , defaultSubmitOptions
  , Ticket
  , findTask
  , watchingTask
  , waitForTask
  , cancelTask
  , retryTask
  , deadTasks

    -- * For those who serve
  , granted
  , decoded
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (forever, unless)
import Data.Aeson (FromJSON, Result (..), ToJSON, Value, fromJSON, toJSON)
import Data.Bifunctor (first)
import Data.Maybe (isJust)
import qualified Data.Set as Set
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Behavior, Seconds)
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Error
import Behavior.Fleet.Internal.Fleet
import Behavior.Fleet.Internal.Options
import Behavior.Parallel (firstOf)
import Behavior.STM (atomically)
import Behavior.Signal (Signal, watching)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Fleet
-- >>> import Behavior.Fleet.Fake
-- >>> import Behavior.Parallel (firstOf)
-- >>> import qualified Behavior.Signal as Signal
-- >>> import Behavior.Sim (simulate, well)
-- >>> import Behavior.Time (now)
-- >>> import Data.Void (absurd)
-- >>> let orders = queue "orders" :: Queue String Int
-- >>> let inFleet act = simulate (newFakeDatabase >>= \db -> withFleet (fakeDatabase db) (Robot "amy" []) act) >>= well

-- | Tasks with inputs and results of these types.
--
-- @since 0.1.0.0
newtype Queue i o = Queue Text

-- | The queue with that name.
--
-- > orders = queue "orders" :: Queue Order Receipt
--
-- @since 0.1.0.0
queue :: String -> Queue i o
queue = Queue . Text.pack

-- | What can be said of a task.
--
-- @since 0.1.0.0
data SubmitOptions = SubmitOptions
  { taskPriority :: Int
  -- ^ Of tasks that wait the one with the largest is started first; 0 by default.
  , taskNeeds :: [String]
  -- ^ What a robot must be capable of ('robotSkills') to start it; nothing by default.
  , startAfter :: Maybe Seconds
  -- ^ It is not started before that time has passed; at once by default.
  , startWithin :: Maybe Seconds
  -- ^ It is not started after that time has passed: then it is dead; however late by default.
  , everyPeriod :: Maybe Seconds
  -- ^ When it has ended, it is submitted again for the next of its times, which are so far apart (at least 1 s). The
  -- key is that of all of them; once by default.
  , taskPauses :: [Seconds]
  -- ^ After each start that has failed: how long until it may be started again. When there is no pause left it is dead.
  -- So there is one start more than pauses. 1 s, 10 s, a minute and ten minutes by default.
  , keepFor :: Seconds
  -- ^ How long it is kept, with its result, after it is done or cancelled; a week by default. Until then its key is
  -- that of this task. (One that is dead is kept.)
  }

-- | The defaults that are documented for each field of 'SubmitOptions'.
--
-- @since 0.1.0.0
defaultSubmitOptions :: SubmitOptions
defaultSubmitOptions =
  SubmitOptions
    { taskPriority = 0
    , taskNeeds = []
    , startAfter = Nothing
    , startWithin = Nothing
    , everyPeriod = Nothing
    , taskPauses = [1, 10, 60, 600]
    , keepFor = 604800
    }

-- | A task that was submitted, with a result of this type.
--
-- @since 0.1.0.0
newtype Ticket o = Ticket TaskNumber
  deriving (Eq, Ord, Show)

-- | Submits a task, with a key of the submitter's choice: the same key again (for example because the submitter was
-- started again) is the same task, and submits nothing.
--
-- > submit fleet orders "order 17" (Order "kitchen" "room 4")
--
-- [Result] When it is in the database. From then on it will be started, and completed at most once.
-- [Failure] 'NoDatabase', and then it may have been submitted: submit it again, with the same key. 'NotAllowed' if the
--   key or the name of the queue has more than 200 characters (or none), or if the key has been submitted with another
--   input or period. (Other options than at first change nothing.)
-- [Fault] 'RestoredFromCopy', 'WrongSchema'; so it is with all that is asked of a fleet's database.
-- [Cancellation] It may have been submitted.
--
-- >>> :{
-- inFleet $ \fleet -> do
--   one <- submit fleet orders "order 1" "a chair"
--   same <- submit fleet orders "order 1" "a chair"
--   (one == same) `seq` submit fleet orders "order 1" "a table" >> pure ()
-- :}
-- *** Exception: it failed: the key 'order 1' of the queue 'orders' is that of a task with another input or period
--
-- @since 0.1.0.0
submit :: ToJSON i => Fleet -> Queue i o -> String -> i -> Behavior (Ticket o)
submit = submitWith defaultSubmitOptions

-- | 'submit' with options. What is not allowed fails with 'NotAllowed'.
--
-- >>> let patrols = queue "patrols" :: Queue String ()
-- >>> :{
-- inFleet $ \fleet -> do
--   let hourly = defaultSubmitOptions {everyPeriod = Just 3600, taskNeeds = ["camera"]}
--   _ <- submitWith hourly fleet patrols "north" "gate 1"
--   _ <- submitWith defaultSubmitOptions {everyPeriod = Just 0.1} fleet patrols "south" "gate 2"
--   pure ()
-- :}
-- *** Exception: it failed: a period has 1 second to 10 years
--
-- @since 0.1.0.0
submitWith :: ToJSON i => SubmitOptions -> Fleet -> Queue i o -> String -> i -> Behavior (Ticket o)
submitWith chosen fleet (Queue name) key input = do
  value <- evaluate (toJSON input)
  answer <-
    request fleet working . Submit $
      Submission
        { toQueue = name
        , withKey = Text.pack key
        , taskInput = value
        , withPriority = taskPriority chosen
        , notBefore = startAfter chosen
        , notAfter = startWithin chosen
        , withNeeds = Set.fromList (map Text.pack (taskNeeds chosen))
        , withPeriod = everyPeriod chosen
        , withPauses = taskPauses chosen
        , keptFor = keepFor chosen
        }
  Ticket <$> granted answer

-- | The task of that key, which may have been submitted elsewhere; Nothing if there is none. (Of periodic ones, that
-- which is to come or runs.)
--
-- @since 0.1.0.0
findTask :: Fleet -> Queue i o -> String -> Behavior (Maybe (Ticket o))
findTask fleet (Queue name) key = fmap (fmap Ticket) (request fleet working (Find name (Text.pack key)) >>= granted)

-- | Runs a behaviour with what is known of a task, as a signal.
--
-- The signal has a value when the database has answered, and then the latest that is known: a change is there at once,
-- and after 'Behavior.Fleet.pollEvery' if its notice was lost. A task that is kept no more has its last one.
--
-- [Failure] The behaviour's. 'NoDatabase'. 'NotDone', if the task is kept no more when this begins.
-- [Cancellation] Requests the stop of the behaviour.
--
-- >>> :{
-- inFleet $ \fleet -> do
--   ticket <- submit fleet orders "order 1" "a chair"
--   firstOf
--     [ absurd <$> serving fleet orders (\_ -> sleep 5 >> pure (pure 0))
--     , watchingTask fleet ticket (Signal.waitUntil . fmap ((== Done) . taskState)) >> now
--     ]
-- :}
-- 5.0
--
-- @since 0.1.0.0
watchingTask :: Fleet -> Ticket o -> (Signal Task -> Behavior a) -> Behavior a
watchingTask fleet (Ticket number) use = do
  known <- newTVarIO Nothing
  withNotices fleet [OfTask number] $ \change ->
    firstOf
      [ use (watching (readTVar known >>= maybe retry pure))
      , forever $ do
          found <- request fleet listening (Look [number]) >>= granted
          mapM_ (atomically . writeTVar known . Just . snd) found
          isKnown <- isJust <$> readTVarIO known
          unless isKnown $ throwIO (NotDone Nothing [])
          change `orAfter` pollEvery (options fleet)
      ]

-- | Waits until the task is done, and gives its result.
--
-- [Failure] 'NotDone' when it is dead or cancelled, or is kept no more. 'NoDatabase'.
-- [Fault] 'UndecodableResult', if its result is not of this type.
-- [Cancellation] Ends the wait; the task goes on.
--
-- @since 0.1.0.0
waitForTask :: FromJSON o => Fleet -> Ticket o -> Behavior o
waitForTask fleet (Ticket number) = withNotices fleet [OfTask number] $ \change ->
  let go = request fleet listening (Look [number]) >>= granted >>= \case
        (_, task) : _
          | taskState task == Done -> either (throwIO . UndecodableResult "the result of the task") pure (resultOf task)
          | taskState task `elem` [Dead, Cancelled] -> throwIO (NotDone (Just (taskState task)) (taskReasons task))
          | otherwise -> change `orAfter` pollEvery (options fleet) >> go
        [] -> throwIO (NotDone Nothing [])
   in go
 where
  resultOf task = maybe (Left "it has none") decoded (taskResult task)

-- | Cancels a task: one that waits at once; of one that runs the robot is interrupted, and it is cancelled when its
-- behaviour has stopped (or its lease ends). Of periodic tasks none comes any more.
--
-- [Result] The state that it has then ('Running', if a robot has to stop first); Nothing if there is no such task. One
--   that has ended stays as it is.
-- [Failure] 'NoDatabase', and then it may have been cancelled.
--
-- >>> :{
-- inFleet $ \fleet -> do
--   _ <- submit fleet orders "order 1" "a chair"
--   cancelTask fleet orders "order 1"
-- :}
-- Just Cancelled
--
-- @since 0.1.0.0
cancelTask :: Fleet -> Queue i o -> String -> Behavior (Maybe TaskState)
cancelTask fleet (Queue name) key = request fleet working (Cancel name (Text.pack key)) >>= granted

-- | Gives a dead task all its starts again, without its deadline: whether there is such a task.
--
-- [Failure] 'NoDatabase', and then it may have been done.
--
-- @since 0.1.0.0
retryTask :: Fleet -> Queue i o -> String -> Behavior Bool
retryTask fleet (Queue name) key = request fleet working (Retry name (Text.pack key)) >>= granted

-- | The tasks of a queue that are dead, with their keys and the reasons; the oldest first, at most a thousand.
--
-- @since 0.1.0.0
deadTasks :: Fleet -> Queue i o -> Behavior [(String, Task)]
deadTasks fleet (Queue name) = map (first Text.unpack) <$> (request fleet working (ListDead name) >>= granted)

-- | What the database gives; what it refuses is thrown.
granted :: Either Refusal a -> Behavior a
granted = either (throwIO . refusedAs) pure

-- | A value of JSON, as a value of that type.
decoded :: FromJSON a => Value -> Either String a
decoded value = case fromJSON value of
  Success a -> Right a
  Error why -> Left why
