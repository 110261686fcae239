{-# LANGUAGE OverloadedStrings #-}

-- |
-- The paper's mission on a robot that speaks ROS: the text of the tree is that of @door-battery@ ("Named"); what the
-- robot does and perceives are its actions and a topic.
module RosMission
  ( mission
  , ended
  ) where

import Control.Exception (SomeException, displayException, fromException)
import Control.Monad (void)
import Data.Int (Int32)

import Behavior
import Behavior.Ros
import Behavior.Ros.Action
import Behavior.Ros.Messages.Sensor
import Behavior.Ros.Messages.Test
import qualified Behavior.Signal as Signal
import Behavior.Trace (named)
import Named

mission :: Ros -> Behavior ()
mission ros = named "mission" (bt (robotOver ros))

-- | As the robot numbers them.
data Door = Door String Int32

robotOver :: Ros -> Robot Door
robotOver ros =
  Robot
    { frontDoor = front
    , backDoor = Door "back door" 2
    , open = at "open"
    , passThrough = at "pass through"
    , close = at "close"
    , smash = at "smash"
    , -- The charger is outside of the room. If no door is open, the robot has closed the front door behind it. (The
      -- goal's end may come before the message that says so: without the wait, the robot would recharge once more.)
      recharge = named "recharge" $ do
        does "recharge" 0 ? (at "open" front >> does "recharge" 0)
        Signal.waitUntil (Signal.named "charged" ((> 90) <$> level))
    , doTask = named "do task" (does "do task" 0)
    , battery = level
    }
 where
  front = Door "front door" 1
  level = round . (* 100) <$> measured percentage (latest ros (topic "/battery_state" (atLeastEvery 2)))
  at what (Door name number) = named (what ++ " " ++ name) (does what number)
  -- (Its type is one that comes with ROS. The order is the number of the door.)
  does what = void . goal ros (action (nameOf what) :: Action Fibonacci) . Order
  nameOf what = '/' : [if c == ' ' then '_' else c | c <- what]

-- | How the mission has ended, in words, and the exit code.
ended :: Either SomeException () -> (String, Int)
ended how = case how of
  Right () -> ("the task is done", 0)
  Left e
    | Just failure <- fromException e -> ("the robot failed: " ++ displayException (failure :: BehaviorFailed), 1)
    | Just (LinkLost _ _) <- fromException e -> (fault e ++ "; what it was doing the robot may still be doing", 3)
    | otherwise -> (fault e, 3)
 where
  fault e = "fault: " ++ displayException e
