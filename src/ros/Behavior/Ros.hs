-- |
-- Robots that speak ROS, over a bridge (rosbridge v2, which ROS 1 and ROS 2 have).
--
-- > battery = topic "/battery_state" (atLeastEvery 2) :: Topic BatteryState
-- >
-- > main = runBehavior . withRos (rosbridge "ws://127.0.0.1:9090") $ \ros -> do
-- >   let batteryLow = (< 0.1) <$> measured percentage (latest ros battery)     -- ROS: from 0 to 1
-- >       driveTo room = goal ros navigate (to room)
-- >   Signal.monitor batteryLow (driveTo "charger") (fallbackOver rooms driveTo)
--
-- What a robot perceives are topics, which become signals ('latest'); what it does are actions ("Behavior.Ros.Action").
-- "Behavior.Ros.Fake" has a robot for tests and simulations.
module Behavior.Ros
  ( -- * The link
    Ros
  , withRos
  , linkUp
  , inNamespace

    -- ** The way to the robot
  , Transport
  , rosbridge
  , rosbridgeTrusting
  , rosbridgeAnywhere

    -- ** What can be set
  , withRosOptions
  , RosOptions (..)
  , defaultRosOptions

    -- * Topics
  , Topic
  , topic
  , Silence
  , atLeastEvery
  , latched
  , upToBytes
  , latest
  , measured
  , withMessages

    -- * Publishing
  , Publication
  , publication
  , untypedPublication
  , keepingLast
  , publishing

    -- * Services
  , RosService (..)
  , Service
  , service
  , untypedService
  , call

    -- * Parameters
  , ParameterValue (..)
  , getParameter
  , setParameter

    -- * Time
  , rosTime

    -- * Messages
  , RosMessage (..)
  , entry
  , entryOr

    -- * What goes wrong
  , RosFailure (..)
  , RosFault (..)
  , movingGoals
  , refusedFrames
  ) where

import Behavior.Ros.Internal.Call
import Behavior.Ros.Internal.Clock
import Behavior.Ros.Internal.Error
import Behavior.Ros.Internal.Keeper
import Behavior.Ros.Internal.Link
import Behavior.Ros.Internal.Message
import Behavior.Ros.Internal.Options
import Behavior.Ros.Internal.Parameter
import Behavior.Ros.Internal.Publication
import Behavior.Ros.Internal.Topic
import Behavior.Ros.Internal.Transport
import Behavior.Ros.Internal.Websocket
