{-# LANGUAGE OverloadedStrings #-}

-- |
-- What the specs of robots share: a fake robot with one action, and schedules.
module Ros.Stage
  ( mission
  , missionWith
  , underSchedules
  , underSchedulesOf
  , carry
  , carrying
  , slowly
  , stopAfter
  , noLink
  , fibonacci
  , failureOrFault
  , patient
  , named
  , inSeconds
  , Masked (..)
  ) where

import Control.Exception (MaskingState, SomeException, fromException, getMaskingState, throwIO)
import Control.Monad (void)
import Data.Aeson (Value (..))
import Data.Text (Text)
import System.IO.Unsafe (unsafePerformIO)

import Behavior
import Behavior.Ros
import Behavior.Ros.Action
import Behavior.Ros.Fake
import Behavior.Sim
import Behavior.Time (now, timeout)

-- | A mission with a fake robot, whose action "/carry" does with each goal what the script says. (It sends few pings,
-- so that it is simulated quickly.)
mission :: (Value -> GoalScript) -> (FakeRobot -> Ros -> Behavior a) -> Behavior a
mission = missionWith defaultRosOptions {pingEvery = 10}

missionWith :: RosOptions -> (Value -> GoalScript) -> (FakeRobot -> Ros -> Behavior a) -> Behavior a
missionWith options script act =
  withFakeRobot [("/carry", script)] $ \robot -> withRosOptions options (fakeRos robot) (act robot)

-- | The behaviour ends without an exception, within ten minutes, under each of that many random schedules, and under
-- the one without pre-emptions.
underSchedules :: Int -> Behavior () -> IO ()
underSchedules = underSchedulesOf 0

-- | 'underSchedules', with the random ones of this seed.
underSchedulesOf :: Int -> Int -> Behavior () -> IO ()
underSchedulesOf seed n act = do
  simulateWith options act >>= well
  void (explore (randomly n) {planSearch = Random n seed, planOptions = options} (\simulated -> simulated act >>= well))
 where
  options = defaultSimOptions {endAt = 600}

carry :: Action Value
carry = untyped "/carry" "my_robot/action/Carry"

-- | Carries that thing.
carrying :: Ros -> Text -> Behavior Value
carrying ros = goal ros carry . String

-- | Takes a minute; a cancel is confirmed after half a second.
slowly :: GoalScript
slowly = succeeding {endsAfter = 60, confirmsAfter = 0.5}

-- | The failure of what has no link to the fake robot in time.
noLink :: RosFailure
noLink = NoServer "the fake robot" "user error (connection refused)"

-- | The real servers' action. (Its type comes with ROS.)
fibonacci :: String -> Action Value
fibonacci name = untyped name "test_msgs/action/Fibonacci"

-- | The name of the failure or the fault, if it is one of robots.
failureOrFault :: SomeException -> Maybe String
failureOrFault e = case (fromException e, fromException e) of
  (Just failure, _) -> Just (head (words (show (failure :: RosFailure))))
  (_, Just fault) -> Just (head (words (show (fault :: RosFault))))
  _ -> Nothing

-- | On a machine that is very busy, an answer may take seconds.
patient :: RosOptions
patient = defaultRosOptions {noServerAfter = 15, patience = 15, pongWithin = 15}

-- | Stops the behaviour after that time, and gives its result, if it has one all the same.
stopAfter :: Seconds -> Behavior a -> Behavior (Maybe a)
stopAfter seconds act = (Just <$> timeout seconds act) ? pure Nothing

-- | A goal by what it carries.
named :: [(Text, GoalScript)] -> Value -> GoalScript
named scripts wanted = case [script | (name, script) <- scripts, String name == wanted] of
  script : _ -> script
  [] -> succeeding

-- | The behaviour takes that long, to a thousandth of a second.
inSeconds :: Seconds -> Behavior a -> Behavior a
inSeconds expected act = do
  begun <- now
  a <- tryAny act
  took <- subtract begun <$> now
  if abs (took - expected) < 0.001
    then either throwIO pure a
    else fail ("it took " ++ show took ++ " s, not " ++ show expected ++ ": " ++ either show (const "it returned") a)

-- | What the thread that reads it holds back: it must be nothing, or no interruption ends a reader that does not end.
newtype Masked = Masked MaskingState
  deriving (Eq, Show)

instance RosMessage Masked where
  fromRos value = pure $! Masked (unsafePerformIO (value `seq` getMaskingState))
  toRos _ = Null
