{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The time of a simulated robot.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Clock
  ( rosTime
  ) where

import Data.Aeson (object, withObject, (.=))

import Behavior (Seconds)
import Behavior.Ros.Internal.Link
import Behavior.Ros.Internal.Message
import Behavior.Ros.Internal.Topic
import Behavior.Ros.Messages (Time, toSeconds)
import Behavior.Signal (Signal)

-- | The time of a robot that is simulated, from the topic @/clock@: a simulator runs faster or slower than the wall,
-- and may be paused. (A real robot has no such topic; its time is that of this program: "Behavior.Time".)
--
-- > sleepThere s = do
-- >   began <- Signal.read (rosTime ros (atLeastEvery 2))
-- >   Signal.waitUntil ((>= began + s) \<$\> rosTime ros (atLeastEvery 2))
--
-- [Failure, fault] As 'latest'.
--
-- @since 0.1.0.0
rosTime :: Ros -> Silence -> Signal Seconds
rosTime ros silence = (\(Clock time) -> toSeconds time) <$> latest ros (topic "/clock" silence)

-- | rosgraph_msgs/msg/Clock.
newtype Clock = Clock Time

instance RosMessage Clock where
  messageType _ = "rosgraph_msgs/msg/Clock"
  fromRos = withObject "Clock" $ \o -> Clock <$> entry o "clock"
  toRos (Clock time) = object ["clock" .= toRos time]
