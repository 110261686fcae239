{-# LANGUAGE FlexibleContexts #-}
{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE TypeFamilies #-}

-- |
-- The action by which Nav2 drives a robot.
--
-- > navigate = replacing (action "/navigate_to_pose") :: Action NavigateToPose
-- > driveTo place = goal ros navigate (to place)
-- > driveTo (at "map" (3, 1.5) 0)
module Behavior.Ros.Messages.Navigation
  ( NavigateToPose
  , NavigateToPoseGoal (..)
  , to
  , NavigateToPoseResult (..)
  , NavigateToPoseFeedback (..)
  ) where

import Data.Aeson (object, withObject, (.=))
import Data.Int (Int16)
import Data.Text (Text)
import Data.Word (Word16)

import Behavior (Seconds)
import Behavior.Ros.Internal.Goal (RosAction (..))
import Behavior.Ros.Internal.Message
import Behavior.Ros.Messages (fromSeconds, toSeconds)
import Behavior.Ros.Messages.Geometry (Pose, Stamped)

-- | nav2_msgs/action/NavigateToPose. (A new goal replaces the one before: 'Behavior.Ros.Action.replacing'.)
--
-- @since 0.1.0.0
data NavigateToPose

instance RosAction NavigateToPose where
  type Goal NavigateToPose = NavigateToPoseGoal
  type Result NavigateToPose = NavigateToPoseResult
  type Feedback NavigateToPose = NavigateToPoseFeedback
  actionType _ = "nav2_msgs/action/NavigateToPose"

-- | Where to drive.
--
-- @since 0.1.0.0
data NavigateToPoseGoal = NavigateToPoseGoal
  { pose :: Stamped Pose
  , behaviorTree :: Text
  -- ^ The file of the behaviour tree that Nav2 is to use; empty for its default.
  }
  deriving (Eq, Show)

-- | There, by the default tree.
--
-- @since 0.1.0.0
to :: Stamped Pose -> NavigateToPoseGoal
to place = NavigateToPoseGoal place ""

instance RosMessage NavigateToPoseGoal where
  fromRos = withObject "NavigateToPose goal" $ \o ->
    NavigateToPoseGoal <$> entry o "pose" <*> entryOr "" o "behavior_tree"
  toRos (NavigateToPoseGoal place tree) = object ["pose" .= toRos place, "behavior_tree" .= tree]

-- | What went wrong, if anything did: of an aborted goal it is in the text of 'Behavior.Ros.Aborted'.
--
-- @since 0.1.0.0
data NavigateToPoseResult = NavigateToPoseResult
  { errorCode :: Word16
  -- ^ 0 if nothing did. (Distributions before Iron have none: 0.)
  , errorMessage :: Text
  -- ^ (Distributions before Kilted have none: empty.)
  }
  deriving (Eq, Show)

instance RosMessage NavigateToPoseResult where
  fromRos = withObject "NavigateToPose result" $ \o ->
    NavigateToPoseResult <$> entryOr 0 o "error_code" <*> entryOr "" o "error_msg"
  toRos (NavigateToPoseResult code message) = object ["error_code" .= code, "error_msg" .= message]

-- | How it goes.
--
-- @since 0.1.0.0
data NavigateToPoseFeedback = NavigateToPoseFeedback
  { currentPose :: Stamped Pose
  , navigationTime :: Seconds
  , estimatedTimeRemaining :: Seconds
  , numberOfRecoveries :: Int16
  , distanceRemaining :: Maybe Double
  -- ^ In metres.
  }
  deriving (Eq, Show)

instance RosMessage NavigateToPoseFeedback where
  fromRos = withObject "NavigateToPose feedback" $ \o ->
    NavigateToPoseFeedback
      <$> entry o "current_pose"
      <*> (toSeconds <$> entry o "navigation_time")
      <*> (toSeconds <$> entry o "estimated_time_remaining")
      <*> entry o "number_of_recoveries"
      <*> entry o "distance_remaining"
  toRos feedback =
    object
      [ "current_pose" .= toRos (currentPose feedback)
      , "navigation_time" .= toRos (fromSeconds (navigationTime feedback))
      , "estimated_time_remaining" .= toRos (fromSeconds (estimatedTimeRemaining feedback))
      , "number_of_recoveries" .= toRos (numberOfRecoveries feedback)
      , "distance_remaining" .= toRos (distanceRemaining feedback)
      ]
