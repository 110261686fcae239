{-# LANGUAGE LambdaCase #-}

-- |
-- What the specs of signals and of the reactive operators share: conditions that a
-- test sets, branches that act in a chosen way when they are stopped, and a count of
-- how many run at once.
module Watched
  ( -- * Conditions
    ConditionState (..)
  , TestCondition
  , newTestCondition
  , set
  , readCondition
  , watched
  , watchedVar

    -- * Filters
  , beginsAfreshAtARecovery

    -- * Sensors
  , Sensor
  , newSensor
  , sensor
  , sensing
  , readings
  , readingsBeyond
  , aWhile

    -- * Recorded reads
  , Recorded (..)
  , newRecorded
  , awaitProcessed
  , hasProcessed

    -- * Branches
  , Stopping (..)
  , onStop
  , awaitBlockedByThread

    -- * Gates
  , opened

    -- * Occupancy
  , OccupancyCounter
  , newOccupancyCounter
  , inside
  , mostInside

    -- * The operators
  , Operator (..)
  , operators
  , latched
  ) where

import Control.Concurrent (ThreadId, myThreadId)
import Control.Concurrent.Async (Async, asyncThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (void)
import Data.IORef (atomicModifyIORef', newIORef, readIORef)
import GHC.Conc (BlockReason (..), ThreadStatus (..), threadStatus, unsafeIOToSTM)
import Test.Hspec (shouldBe, shouldReturn)

import Behavior (Behavior, Seconds, failWith)
import Behavior.Internal.Seam.Runtime (atomically)
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Sim (Run (finished), explore, randomly)
import Support

-- | The state of a condition.
data ConditionState
  = Value Bool
  | SensorFailure
  | SensorFault
  | NoValue
  deriving (Eq, Show)

-- | A condition that the test sets.
type TestCondition = TVar ConditionState

newTestCondition :: Bool -> IO TestCondition
newTestCondition = newTVarIO . Value

set :: TestCondition -> ConditionState -> IO ()
set condition = atomically . writeTVar condition

readCondition :: TestCondition -> STM Bool
readCondition condition =
  readTVar condition >>= \case
    Value holds -> pure holds
    SensorFailure -> failWith "the sensor"
    SensorFault -> throwSTM (Fault "the sensor")
    NoValue -> retry

watched :: TestCondition -> Signal Bool
watched = Signal.watching . readCondition

-- | The signal of a plain variable.
watchedVar :: TVar a -> Signal a
watchedVar = Signal.watching . readTVar

-- | Under any schedule, the first value after a recovery counts at once for an operator that watches through this
-- filter, and the one before the recovery does not.
beginsAfreshAtARecovery :: (Signal Bool -> Signal Bool) -> IO ()
beginsAfreshAtARecovery through =
  void . explore (randomly 200) $ \simulated -> do
    entries <- newLog
    level <- newTVarIO True
    let recovery = note entries "recovery" >> atomically (writeTVar level False)
    run <- simulated (Signal.monitor (through (watchedVar level)) recovery (note entries "task"))
    finished run `shouldBe` 0
    notes entries `shouldReturn` ["recovery", "task"]

-- | A sensor that counts its readings. Its function gives what each reading does, by
-- the reading's number from 1.
data Sensor a = Sensor (TVar Int) (Int -> Behavior a)

newSensor :: (Int -> Behavior a) -> IO (Sensor a)
newSensor act = (`Sensor` act) <$> newTVarIO 0

-- | Reads the sensor.
sensor :: Sensor a -> Behavior a
sensor (Sensor count act) =
  atomically (modifyTVar' count (+ 1) >> readTVar count) >>= act

-- | Polls the sensor every millisecond.
sensing :: Sensor a -> Signal a
sensing = Signal.polling 0.001 . sensor

-- | How many readings have begun.
readings :: Sensor a -> IO Int
readings (Sensor count _) = readTVarIO count

-- | Waits until the given number of further readings have begun.
readingsBeyond :: Int -> Sensor a -> IO ()
readingsBeyond more s@(Sensor count _) = do
  before <- readings s
  atomically (readTVar count >>= check . (>= before + more))

-- | Waits while a sensor of its own is read twenty times, at the given period: time
-- enough for an event that must not happen.
aWhile :: Seconds -> Behavior ()
aWhile every = do
  own <- newSensor (pure . (> 20))
  Signal.waitUntil (Signal.polling every (sensor own))

-- | A variable whose signal records which threads have read it.
data Recorded a = Recorded
  { underlying :: TVar a
  , recorded :: Signal a
  , readCount :: (ThreadId -> Bool) -> a -> IO Int
  -- ^ How often the threads of the given predicate have read it since it has this value.
  }

newRecorded :: Eq a => a -> IO (Recorded a)
newRecorded initial = do
  var <- newTVarIO initial
  seen <- newIORef []
  pure
    Recorded
      { underlying = var
      , recorded = Signal.watching $ do
          value <- readTVar var
          unsafeIOToSTM $ do
            self <- myThreadId
            value <$ atomicModifyIORef' seen (\known -> ((self, value) : known, ()))
      , readCount = \meant value ->
          length . takeWhile ((== value) . snd) . filter (meant . fst) <$> readIORef seen
      }

-- | Waits until a worker of the operator that the caller runs has read the value and
-- processed it: the worker then reads it a second time.
awaitProcessed :: Recorded a -> Async b -> a -> IO ()
awaitProcessed var caller = eventually . hasProcessed var caller

hasProcessed :: Recorded a -> Async b -> a -> IO Bool
hasProcessed var caller value = (>= 2) <$> readCount var (/= asyncThreadId caller) value

-- | What a branch does when its stop is requested.
data Stopping = Cleanly | Completing | Failing | Faulting
  deriving (Eq, Show, Enum, Bounded)

-- | Runs a branch that does the given thing when its stop is requested: it stops,
-- completes with the given name, or fails or faults with that name.
onStop :: Stopping -> String -> Behavior String -> Behavior String
onStop how name act =
  act `catch` \e -> case how of
    Cleanly -> throwIO (e :: SomeAsyncException)
    Completing -> pure name
    Failing -> throwIO (Failure name)
    Faulting -> throwIO (Fault name)

-- | Returns once the thread is blocked by another one: until that one has received an
-- exception, or has ended.
awaitBlockedByThread :: ThreadId -> IO ()
awaitBlockedByThread thread =
  eventually ((`elem` map ThreadBlocked [BlockedOnException, BlockedOnSTM]) <$> threadStatus thread)

-- | Whether the gate is open.
opened :: Gate -> IO Bool
opened gate = atomically ((True <$ passed gate) `orElse` pure False)

-- | Counts how many branches are inside at the same time; at most one may be.
data OccupancyCounter = OccupancyCounter (TVar Int) (TVar Int)

newOccupancyCounter :: IO OccupancyCounter
newOccupancyCounter = OccupancyCounter <$> newTVarIO 0 <*> newTVarIO 0

-- | Runs the action inside.
inside :: OccupancyCounter -> IO a -> IO a
inside (OccupancyCounter now most) = bracket_ enter leave
 where
  enter = atomically $ do
    modifyTVar' now (+ 1)
    n <- readTVar now
    modifyTVar' most (max n)
  leave = atomically (modifyTVar' now (subtract 1))

-- | The largest number that were inside at the same time.
mostInside :: OccupancyCounter -> IO Int
mostInside (OccupancyCounter _ most) = readTVarIO most

-- | An operator that runs one behaviour while its condition holds.
data Operator = Operator
  { operator :: String
  , running :: Signal Bool -> Behavior String -> Behavior String -> Behavior String
  -- ^ The condition; what runs while it holds; what runs while it does not, if the
  -- operator has such a branch.
  }

instance Show Operator where
  show = operator

-- | All operators that interrupt a branch. 'Signal.monitor' gets the negated condition.
operators :: [Operator]
operators =
  [ Operator "rSelect" Signal.rSelect
  , Operator "monitor" (\c main other -> Signal.monitor (not <$> c) (void other) main)
  , Operator "switch" (\c main other -> Signal.switch c (\holds -> if holds then main else other))
  , Operator "teleoReactive" $ \c main other ->
      Signal.teleoReactive [(c, main), (pure True, other)]
  , Operator "insteadWhen" (\c main other -> Signal.insteadWhen (not <$> c) other main)
  , Operator "whileHolding" (\c main _ -> Signal.whileHolding c main)
  ]

-- | Whether the change is latched: the second behaviour runs even if the first fails or faults
-- while it stops.
latched :: Operator -> Bool
latched op = operator op `elem` ["monitor", "insteadWhen"]
