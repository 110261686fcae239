{-# LANGUAGE OverloadedStrings #-}

-- |
-- The paper's mission on a robot that no one here has written (examples/ros-mission/robot.py).
module Robots.Missions (missions) where

import Control.Monad (void)
import Data.Aeson (object, (.=))
import Data.Foldable (for_)

import Behavior
import Behavior.Ros
import Behavior.Time (timeout)
import Robots.Campaign
import RosMission

-- | One after the other; the robot draws the state of its doors, and when its battery falls low.
missions :: Campaign -> Behavior ()
missions campaign = withBridge campaign 1 $ \_ bridge -> withRosOptions quickly bridge $ \ros -> do
  awaitBridge ros
  let prepare = void (call ros (untypedService "/new_mission" "std_srvs/srv/Trigger") (object []))
  -- (A bridge that has just started loses calls, and goals, until it knows their servers.)
  attempt 20 prepare
  for_ [1 .. if isLong campaign then 100 else 20 :: Int] $ \n -> do
    prepare
    begun <- clock
    how <- tryAny (timeout 60 (mission ros))
    over <- clock
    note campaign 1 ["mission" .= n, "begun" .= begun, "ended" .= over, "how" .= fst (ended how)]
 where
  quickly = defaultRosOptions {tooSlowAfter = 1}
