{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- What the server of an action says about its goals.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Status
  ( statusOf
  , Statuses (..)
  , goalId
  , hasEnded
  ) where

import Data.Aeson (Value, object, withObject, (.=))
import Data.Aeson.Types (Parser)
import Data.Text (Text)

import Behavior.Ros.Internal.Message

-- | The topic of an action's server on which it says that.
statusOf :: Text -> Text
statusOf action = action <> "/_action/status"

-- | The server's goals, those of other programs included, each with its status: action_msgs/msg/GoalStatusArray.
newtype Statuses = Statuses [(Value, Int)]

instance RosMessage Statuses where
  messageType _ = "action_msgs/msg/GoalStatusArray"
  fromRos = withObject "GoalStatusArray" $ \o -> Statuses <$> (entry o "status_list" >>= traverse status)
   where
    status = withObject "GoalStatus" $ \o -> (,) <$> (entry o "goal_info" >>= goalId) <*> entry o "status"
  toRos (Statuses known) =
    object ["status_list" .= [object ["goal_info" .= object ["goal_id" .= g], "status" .= how] | (g, how) <- known]]

-- | How the server names a goal.
goalId :: Value -> Parser Value
goalId = withObject "GoalInfo" (`entry` "goal_id")

-- | Whether the goal has ended: it has succeeded (4), was cancelled (5), or aborted (6).
hasEnded :: Int -> Bool
hasEnded = (`elem` [4, 5, 6])
