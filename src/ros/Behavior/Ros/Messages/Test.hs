{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE TypeFamilies #-}

-- |
-- The action with which ROS is tried out.
--
-- > fibonacci = action "/fibonacci" :: Action Fibonacci
-- > goal ros fibonacci (Order 7)
module Behavior.Ros.Messages.Test
  ( Fibonacci
  , Order (..)
  , Sequence (..)
  ) where

import Data.Aeson (object, withObject, (.=))
import Data.Int (Int32)

import Behavior.Ros.Internal.Goal (RosAction (..))
import Behavior.Ros.Internal.Message

-- | test_msgs/action/Fibonacci.
--
-- @since 0.1.0.0
data Fibonacci

instance RosAction Fibonacci where
  type Goal Fibonacci = Order
  type Result Fibonacci = Sequence
  type Feedback Fibonacci = Sequence
  actionType _ = "test_msgs/action/Fibonacci"

-- | How many numbers of the sequence are wanted.
--
-- @since 0.1.0.0
newtype Order = Order Int32
  deriving (Eq, Show)

instance RosMessage Order where
  fromRos = withObject "Fibonacci goal" $ \o -> Order <$> entry o "order"
  toRos (Order n) = object ["order" .= n]

-- | The numbers so far.
--
-- @since 0.1.0.0
newtype Sequence = Sequence [Int32]
  deriving (Eq, Show)

instance RosMessage Sequence where
  fromRos = withObject "Fibonacci result" $ \o -> Sequence <$> entry o "sequence"
  toRos (Sequence numbers) = object ["sequence" .= toRos numbers]
