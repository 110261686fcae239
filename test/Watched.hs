{-# LANGUAGE LambdaCase #-}

-- |
-- What the specs of signals and of the reactive operators share: conditions that a
-- test sets, branches that act in a chosen way when they are stopped, and a count of
-- how many run at once.
module Watched
  ( -- * Conditions
    Says (..)
  , TestCondition
  , newTestCondition
  , set
  , says
  , watched
  , dialled

    -- * Sensors
  , Sensor
  , newSensor
  , sensor
  , sensing
  , readings
  , readingsBeyond
  , aWhile

    -- * Who looks
  , Recorded (..)
  , newRecorded
  , noticed
  , hasNoticed

    -- * Branches
  , Stopping (..)
  , onStop
  , awaitUnheard

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
  ) where

import Control.Concurrent (ThreadId, myThreadId)
import Control.Concurrent.Async (Async, asyncThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (void)
import Data.IORef (atomicModifyIORef', newIORef, readIORef)
import GHC.Conc (BlockReason (..), ThreadStatus (..), threadStatus, unsafeIOToSTM)

import Behavior (Behavior, Seconds, failWith)
import Behavior.Internal.Runtime (atomically)
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Support

-- | What a condition says.
data Says
  = Says Bool
  | SaysFailure
  | SaysFault
  | SaysNothing
  deriving (Eq, Show)

-- | A condition that the test sets.
type TestCondition = TVar Says

newTestCondition :: Bool -> IO TestCondition
newTestCondition = newTVarIO . Says

set :: TestCondition -> Says -> IO ()
set condition = atomically . writeTVar condition

says :: TestCondition -> STM Bool
says condition =
  readTVar condition >>= \case
    Says holds -> pure holds
    SaysFailure -> failWith "the sensor"
    SaysFault -> throwSTM (Fault "the sensor")
    SaysNothing -> retry

watched :: TestCondition -> Signal Bool
watched = Signal.watching . says

-- | The signal of a plain variable.
dialled :: TVar a -> Signal a
dialled = Signal.watching . readTVar

-- | A sensor that counts its readings, and does what the test says for each of
-- them, by its number from 1.
data Sensor a = Sensor (TVar Int) (Int -> Behavior a)

newSensor :: (Int -> Behavior a) -> IO (Sensor a)
newSensor act = (`Sensor` act) <$> newTVarIO 0

-- | Reads the sensor.
sensor :: Sensor a -> Behavior a
sensor (Sensor count act) =
  atomically (modifyTVar' count (+ 1) >> readTVar count) >>= act

-- | Asks the sensor every millisecond.
sensing :: Sensor a -> Signal a
sensing = Signal.polling 0.001 . sensor

-- | How many readings have begun.
readings :: Sensor a -> IO Int
readings (Sensor count _) = readTVarIO count

-- | Waits until so many more readings have begun.
readingsBeyond :: Int -> Sensor a -> IO ()
readingsBeyond more s@(Sensor count _) = do
  before <- readings s
  atomically (readTVar count >>= check . (>= before + more))

-- | As long as it takes a sensor of our own to be read twenty times, once in so
-- many seconds: time for something to happen that must not.
aWhile :: Seconds -> Behavior ()
aWhile every = do
  own <- newSensor (pure . (> 20))
  Signal.waitUntil (Signal.polling every (sensor own))

-- | A variable whose signal records who has looked at it.
data Recorded a = Recorded
  { underlying :: TVar a
  , recorded :: Signal a
  , looks :: (ThreadId -> Bool) -> a -> IO Int
  -- ^ How often the threads that are meant have looked at it since it has this value.
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
            value <$ atomicModifyIORef' seen (\all' -> ((self, value) : all', ()))
      , looks = \meant value ->
          length . takeWhile ((== value) . snd) . filter (meant . fst) <$> readIORef seen
      }

-- | Waits until a worker of the operator that the caller runs has seen the value and
-- done what there is to do: it looks for the second time.
noticed :: Recorded a -> Async b -> a -> IO ()
noticed var caller = eventually . hasNoticed var caller

hasNoticed :: Recorded a -> Async b -> a -> IO Bool
hasNoticed var caller value = (>= 2) <$> looks var (/= asyncThreadId caller) value

-- | What a branch does when it is asked to stop.
data Stopping = Cleanly | Completing | Failing | Faulting
  deriving (Eq, Show, Enum, Bounded)

-- | Runs a branch, and when it is asked to stop does as it is told, with the given
-- name: it stops, completes with that name, or fails or faults saying it.
onStop :: Stopping -> String -> Behavior String -> Behavior String
onStop how name act =
  act `catch` \e -> case how of
    Cleanly -> throwIO (e :: SomeAsyncException)
    Completing -> pure name
    Failing -> throwIO (Failure name)
    Faulting -> throwIO (Fault name)

-- | Returns once the thread waits for another one: until that has received an exception, or
-- has ended.
awaitUnheard :: ThreadId -> IO ()
awaitUnheard thread = eventually ((`elem` map ThreadBlocked [BlockedOnException, BlockedOnSTM]) <$> threadStatus thread)

-- | Whether the gate is open.
opened :: Gate -> IO Bool
opened gate = atomically ((True <$ passed gate) `orElse` pure False)

-- | Where at most one may be at a time.
data OccupancyCounter = OccupancyCounter (TVar Int) (TVar Int)

newOccupancyCounter :: IO OccupancyCounter
newOccupancyCounter = OccupancyCounter <$> newTVarIO 0 <*> newTVarIO 0

-- | Acts inside the room.
inside :: OccupancyCounter -> IO a -> IO a
inside (OccupancyCounter now most) = bracket_ enter leave
 where
  enter = atomically $ do
    modifyTVar' now (+ 1)
    n <- readTVar now
    modifyTVar' most (max n)
  leave = atomically (modifyTVar' now (subtract 1))

-- | How many there have been at once, at most.
mostInside :: OccupancyCounter -> IO Int
mostInside (OccupancyCounter _ most) = readTVarIO most

-- | An operator that runs one behaviour while its condition holds.
data Operator = Operator
  { operator :: String
  , running :: Signal Bool -> Behavior String -> Behavior String -> Behavior String
  -- ^ The condition; what runs while it holds; what runs while it does not, if the
  -- operator has such a thing.
  }

instance Show Operator where
  show = operator

-- | All that interrupt a branch. 'Signal.monitor' watches for the contrary.
operators :: [Operator]
operators =
  [ Operator "rSelect" Signal.rSelect
  , Operator "monitor" (\c main other -> Signal.monitor (not <$> c) (void other) main)
  , Operator "switch" (\c main other -> Signal.switch c (\holds -> if holds then main else other))
  , Operator "teleoReactive" $ \c main other ->
      Signal.teleoReactive [(c, main), (pure True, other)]
  , Operator "whileHolding" (\c main _ -> Signal.whileHolding c main)
  ]
