{-# LANGUAGE RecordWildCards #-}

-- |
-- The paper's mission once more, with names for what a picture shows. It is given the robot: so @door-battery@ runs it
-- in the mock world, and @ros-mission@ on a robot that speaks ROS.
module Named
  ( Robot (..)
  , bt
  ) where

import Behavior
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Trace (named)

-- | What the robot can do and perceive. (What it does has names in a picture, if the robot gives it some.)
data Robot door = Robot
  { frontDoor, backDoor :: door
  , open, passThrough, close, smash :: door -> Behavior ()
  , recharge, doTask :: Behavior ()
  , battery :: Signal Int
  -- ^ Percent.
  }

bt :: Robot door -> Behavior ()
bt Robot {..} = Signal.monitor batteryLow recharge (named "enter room" enterRoom >> doTask)
 where
  batteryLow = Signal.named "battery low" ((< 10) <$> Signal.named "battery" battery)
  enterRoom =
    (open frontDoor >> passThrough frontDoor >> close frontDoor)
      ? ((open backDoor ? smash backDoor) >> passThrough backDoor)
