{-# LANGUAGE OverloadedStrings #-}

-- |
-- What others test of their own clients of actions, restated for 'goal': each example has the name of their test, and
-- says what that asserts. (The ticks of their trees are times here.)
module Ros.PeersSpec (spec) where

import Control.Exception (try)
import Control.Monad (void)
import Data.Aeson (Value (..))
import Data.Int (Int32)
import Data.Maybe (fromMaybe)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Action
import Behavior.Ros.Fake
import Behavior.Ros.Messages.Test
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Time
import Ros.Stage
import Support (guarded)

spec :: Spec
spec = guarded $ do
  describe "nav2's BTActionNodeTestFixture:" $ do
    it "test_server_timeout_success: a goal that is accepted in time succeeds; one that is not fails"
      . underSchedules 100
      . counting 1e-8 [(5, 0.002), (6, 0.1)]
      $ \robot ros -> do
        timeout 0.02 (count ros 5) >>= (`shouldBe` Sequence [0, 1, 1, 2, 3, 5])
        robot `ended` [4]
        timesOut (timeout 0.02 (count ros 6))
    it "test_server_timeout_failure: a goal that is accepted too late fails; the next one succeeds"
      . underSchedules 100
      . counting 1e-8 [(2, 0.1), (3, 0.025)]
      $ \robot ros -> do
        timesOut (timeout 0.09 (count ros 2))
        -- (It has ended as soon as it was accepted, before a cancel came.)
        robot `ended` [4]
        timeout 0.09 (count ros 3) >>= (`shouldBe` Sequence [0, 1, 1, 2])
    it "test_goal_rejected: a rejected goal fails at once, and not as others do" . underSchedules 100 $
      withServer (const succeeding {endsWith = Refuses}) $ \_ ros ->
        inSeconds 0 (try (count ros 2)) >>= (`shouldBe` Left (Rejected "/fibonacci" "the goal was not accepted"))
    it "test_server_cancel: a goal that is halted is cancelled, and so is the next one" . underSchedules 100 $
      counting 0.05 [] $ \robot ros -> do
        inSeconds 0.55 (stopAfter 0.5 (count ros 1000000)) >>= (`shouldBe` Nothing)
        robot `ended` [5]
        inSeconds 0.75 (stopAfter 0.7 (count ros 1000000)) >>= (`shouldBe` Nothing)
        robot `ended` [5, 5]
  it "nav2's issue 6426: a goal that is halted before it was accepted is cancelled all the same, and no other one is" .
    underSchedules 100 . counting 0.05 [(1000000, 0.2)] $ \robot other -> do
      let halted = withRos (fakeRos robot) $ \ros -> do
            sleep 1
            -- (Cancels come after 1 to 101 ms, and 141 ms, too early; the next one after 221 ms.)
            inSeconds 0.271 (stopAfter 0.001 (count ros 1000000)) >>= (`shouldBe` Nothing)
            robot `runs` [1]
            robot `ended` [5]
      firstOf [halted, void (count other 2000000)]

  describe "py_trees_ros' test_action_client:" $ do
    it "test_success: a goal is not sent before it is its turn, then runs, then succeeds" . underSchedules 100 $
      withServer docks $ \robot ros -> do
        sleep 0.1
        robot `runs` []
        both (sleep 0.1 >> robot `runs` [1]) (inSeconds 1.5 (dock ros True))
        robot `ended` [4]
    it "test_priority_interrupt: a goal is cancelled when what has priority succeeds after some failures"
      . underSchedules 100
      . withServer docks
      $ \robot ros -> do
        failures <- newTVarIO (0 :: Int)
        let failing = sleep 0.1 >> atomically (modifyTVar' failures (+ 1)) >> failing
            succeeds = (>= 4) <$> Signal.watching (readTVar failures)
        firstOf [failing, Signal.insteadWhen succeeds (robot `runs` []) (dock ros True)]
        robot `ended` [5]
    it "test_rejection: fails" . underSchedules 100 . withServer (const succeeding {endsWith = Refuses}) $
      \_ ros -> fails (dock ros True)
    it "test_aborted: fails" . underSchedules 100 . withServer (const succeeding {endsWith = Aborts Null}) $
      \_ ros -> fails (dock ros True)
    it "test_from_blackboard: fails while there is no goal on the blackboard, and runs when there is one"
      . underSchedules 100
      . withServer docks
      $ \robot ros -> do
        blackboard <- newTVarIO Nothing
        let fromBlackboard = readTVarIO blackboard >>= maybe failed (dock ros)
        fails fromBlackboard
        robot `ended` []
        atomically (writeTVar blackboard (Just True))
        both (sleep 0.1 >> robot `runs` [1]) fromBlackboard
    it "test_timeouts: fails after the time that was set, if there is no server" . underSchedules 100 $
      withFakeRobot [] $ \robot -> do
        loseLink robot
        withRosOptions defaultRosOptions {noServerAfter = 0.1} (fakeRos robot) $ \ros ->
          inSeconds 0.1 (try (dock ros True)) >>= (`shouldBe` Left noLink)

-- | A robot with a server of nav2's test: it counts with that period, and looks as often whether it is to stop; goals
-- of these orders it accepts only after a time.
counting :: Seconds -> [(Int32, Seconds)] -> (FakeRobot -> Ros -> Behavior a) -> Behavior a
counting period accepting = withServer $ \wanted ->
  let order = head ([n | n <- [2 .. 6] ++ [1000000, 2000000], wanted == toRos (Order n)] ++ [error "no such order"])
  in succeeding
      { acceptedAfter = fromMaybe 0.002 (lookup order accepting)
      , endsAfter = period * fromIntegral order
      , endsWith = Succeeds (toRos (Sequence (take (fromIntegral order + 1) numbers)))
      , confirmsAfter = period
      }
 where
  numbers = 0 : scanl (+) 1 numbers

-- | A robot with that server.
withServer :: (Value -> GoalScript) -> (FakeRobot -> Ros -> Behavior a) -> Behavior a
withServer script act = withFakeRobot [("/fibonacci", script), ("/dock", script)] $ \robot ->
  withRosOptions defaultRosOptions {pingEvery = 10} (fakeRos robot) (act robot)

count :: Ros -> Int32 -> Behavior Sequence
count ros = goal ros (action "/fibonacci" :: Action Fibonacci) . Order

-- | A server of py_trees_ros' test.
docks :: Value -> GoalScript
docks _ = succeeding {endsAfter = 1.5}

dock :: Ros -> Bool -> Behavior ()
dock ros = void . goal ros (untyped "/dock" "py_trees_ros_interfaces/action/Dock") . Bool

-- | It fails, and does not fault.
fails :: Behavior a -> Behavior ()
fails act = (False <$ act) ? pure True >>= (`shouldBe` True)

timesOut :: Show a => Behavior a -> Behavior ()
timesOut act = try act >>= either (\(TimedOut _) -> pure ()) (expectationFailure . ("it gave " ++) . show)

-- | With these statuses the robot's goals have ended.
ended :: FakeRobot -> [Int] -> Behavior ()
ended robot expected = atomically (seen robot) >>= \events -> [how | (_, GoalEnded _ how) <- events] `shouldBe` expected

-- | These goals run on the robot.
runs :: FakeRobot -> [Int] -> Behavior ()
runs robot expected = atomically (runningGoals robot) >>= (`shouldBe` expected)
