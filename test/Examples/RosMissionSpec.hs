{-# LANGUAGE OverloadedStrings #-}

-- |
-- The paper's mission on a fake robot that speaks ROS: whatever goes wrong, and under each schedule, the robot does one
-- thing at a time, and the mission ends as it should.
module Examples.RosMissionSpec (spec) where

import Control.Monad (forever, unless)
import Data.Aeson (Value, object, (.=))
import Data.Foldable (for_, traverse_)
import Data.List (isInfixOf)
import Test.Hspec hiding (before)

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Fake
import Behavior.Ros.Messages.Sensor
import Behavior.STM
import Behavior.Time
import Ros.Stage (underSchedules, underSchedulesOf)
import RosMission
import Support (guarded)

spec :: Spec
spec = guarded $ do
  it "enters by the front door, and closes it" $ calm `endsWell` throughFront
  it "enters by the back door if the front door is locked, and smashes that if it is locked, too" $ do
    calm {does = locked ["open 1"]} `endsWell` ["open", "open", "pass_through", "do_task"]
    calm {does = locked ["open 1", "open 2"]} `endsWell` ["open", "open", "smash", "pass_through", "do_task"]
  it "takes a goal that is rejected for one that failed" $
    calm {does = \what -> if what == "open 1" then slow {endsWith = Refuses} else locked ["pass_through 1"] what}
      `endsWell` ["open", "open", "pass_through", "do_task"]
  -- (Such a day takes long to simulate: a third of the schedules an example.)
  for_ [0 .. 2] $ \seed ->
    it ("waits for goals that take long, under schedules of seed " ++ show seed) . underSchedulesOf seed 20 $
      calm {does = const slow {acceptedAfter = 9, endsAfter = 90}} `isSeen` ("the task is done", throughFront)
  it "fails if the robot can do nothing" $
    calm {does = const aborted} `ends` (failing "enter room > smash back door" "/smash", ["open", "open", "smash"])
  describe "when the battery is low" $ do
    it "recharges, and begins again" . for_ (zip [0.3, 1.3, 2.3, 3.3] [1 ..]) $ \(moment, n) ->
      calm {low = [moment]} `endsWell` (take n throughFront ++ "recharge" : throughFront)
    for_ [1, 1.5, 2, 2.5, 3] $ \moment ->
      it ("also when that coincides with the end of a goal, and once more: " ++ show moment ++ " s") $
        calm {low = [moment, moment + 3]} `endsAfterRecharging` throughFront
    it "opens the door from inside, if there is no way to the charger" $
      calm {low = [3.3], does = locked ["recharge 0"]}
        `ends` (failing "recharge" "/recharge", throughFront ++ ["recharge", "open", "recharge"])
    it "and a goal does not stop: recharges all the same, and ends with that fault" $
      calm {low = [1.3], does = \what -> if what == "open 1" then stubborn else slow}
        `ends` ("fault: /open has not confirmed that the goal has stopped", ["open", "recharge"])
  it "stops the robot, and ends, when the battery's topic falls silent" $
    calm {silentFrom = 1.3, does = const slow {endsAfter = 50}}
      `ends` ("fault: no message on /battery_state within 2.0 s", ["open"])
  it "ends when the link is lost, sends nothing more, and says that the robot may still move" $
    calm {lostAt = 1.3} `ends` ("what it was doing the robot may still be doing", ["open", "pass_through"])
 where
  throughFront = ["open", "pass_through", "close", "do_task"]
  locked these what = if what `elem` these then aborted else slow
  aborted = slow {endsWith = Aborts (object ["sequence" .= [0 :: Int]])}
  failing place name =
    concat
      ["the robot failed: mission > ", place, " > goal: ", name, ": ", name, " aborted the goal: {\"sequence\":[0]}"]
  stubborn = slow {endsAfter = 50, confirmsAfter = 1 / 0}

-- | What the robot does with a goal (its action, and the number of the door), and what happens when.
data Day = Day
  { does :: String -> GoalScript
  , low :: [Seconds]
  , silentFrom, lostAt :: Seconds
  }

calm :: Day
calm = Day {does = const slow, low = [], silentFrom = 1 / 0, lostAt = 1 / 0}

-- | Takes a second; a cancel is confirmed after 0.2 s.
slow :: GoalScript
slow = succeeding {endsWith = Succeeds (object ["sequence" .= ([] :: [Int])]), confirmsAfter = 0.2}

endsWell :: Day -> [String] -> Expectation
endsWell day goals = day `ends` ("the task is done", goals)

-- | The mission ends with this in its text, and these goals were sent.
ends :: Day -> (String, [String]) -> Expectation
ends day = underSchedules 60 . isSeen day

isSeen :: Day -> (String, [String]) -> Behavior ()
isSeen day (text, goals) = do
  (said, came) <- missionOn day
  said `shouldContain` text
  came `shouldBe` goals

-- | These are the goals after the last recharging, of which there was one.
endsAfterRecharging :: Day -> [String] -> Expectation
endsAfterRecharging day goals = underSchedules 60 $ do
  (said, came) <- missionOn day
  said `shouldBe` "the task is done"
  came `shouldContain` ["recharge"]
  reverse (takeWhile (/= "recharge") (reverse came)) `shouldBe` goals

-- | The mission on such a day: how it ends, and which goals were sent.
missionOn :: Day -> Behavior (String, [String])
missionOn day = withFakeRobot [('/' : name, script name) | name <- names] $ \robot -> do
  level <- newTVarIO 1
  let says p = publish robot "/battery_state" (toRos (BatteryState Nothing (Just p) False))
      alive = timeout (silentFrom day) (forever (readTVarIO level >>= says >> sleep 0.5)) ? sleepForever
      falls = traverse_ (\moment -> sleepUntil moment >> atomically (writeTVar level 0.05)) (low day) >> sleepForever
      charges n = do
        atomically (seen robot >>= check . (> n) . length . recharged)
        atomically (writeTVar level 1) >> charges (n + 1)
      breaks = sleepUntil (lostAt day) >> loseLink robot >> sleepForever
      program = withRosOptions defaultRosOptions {pingEvery = 10} (fakeRos robot) mission
  how <- firstOf [alive, falls, charges 0, breaks, tryAny program]
  events <- atomically (seen robot)
  let text = fst (ended how)
  -- (What a lost link, or a goal that does not stop, leaves behind is said.)
  unless ("may still" `isInfixOf` text) (oneAtATime events)
  pure (text, [drop 1 name | (_, GoalCame _ name _) <- events])
 where
  names = ["open", "pass_through", "close", "smash", "recharge", "do_task"]
  script name wanted = does day (name ++ " " ++ show (orderOf wanted))
  recharged events =
    [n | (_, GoalEnded n 4) <- events, (_, GoalCame m "/recharge" _) <- events, m == n]

-- | The number of the door.
orderOf :: Value -> Int
orderOf wanted = head ([n | n <- [0 .. 2], wanted == object ["order" .= n]] ++ [error "no such door"])

-- | Each goal ended before the next one came, and none is left.
oneAtATime :: [(Seconds, Seen)] -> Behavior ()
oneAtATime events = unless (inTurn (concatMap (number . snd) events)) $ failWith ("two at a time: " ++ show events)
 where
  number event = case event of
    GoalCame n _ _ -> [n]
    GoalEnded n _ -> [n]
    _ -> []
  inTurn (came : end : more) = came == end && inTurn more
  inTurn left = null left
