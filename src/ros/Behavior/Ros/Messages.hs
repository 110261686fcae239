{-# LANGUAGE FlexibleInstances #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- Some of the messages that ROS has: those of std_msgs that contain one thing, and the state of a battery. Others
-- are read as 'Data.Aeson.Value', or are instances of 'RosMessage' of your own.
module Behavior.Ros.Messages
  ( -- * std_msgs
    Std (..)

    -- * sensor_msgs
  , BatteryState (..)
  ) where

import Data.Aeson (Value, object, withObject, (.=))
import Data.Aeson.Types (Parser)
import Data.Int (Int32, Int64)
import Data.Text (Text)
import Data.Word (Word8)

import Behavior.Ros.Internal.Message

-- | A message of std_msgs: @Bool@, @Float64@ (as a 'Maybe' 'Double'), @Int32@, @Int64@ or @String@.
--
-- @since 0.1.0.0
newtype Std a = Std {unStd :: a}
  deriving (Eq, Ord, Show)

instance RosMessage (Std Bool) where
  messageType _ = "std_msgs/msg/Bool"
  fromRos = dataOf
  toRos = asData

instance RosMessage (Std (Maybe Double)) where
  messageType _ = "std_msgs/msg/Float64"
  fromRos = dataOf
  toRos = asData

instance RosMessage (Std Int32) where
  messageType _ = "std_msgs/msg/Int32"
  fromRos = dataOf
  toRos = asData

instance RosMessage (Std Int64) where
  messageType _ = "std_msgs/msg/Int64"
  fromRos = dataOf
  toRos = asData

instance RosMessage (Std Text) where
  messageType _ = "std_msgs/msg/String"
  fromRos = dataOf
  toRos = asData

dataOf :: RosMessage a => Value -> Parser (Std a)
dataOf = withObject "a message of std_msgs" $ \o -> Std <$> entry o "data"

asData :: RosMessage a => Std a -> Value
asData (Std a) = object ["data" .= toRos a]

-- | A part of sensor_msgs/msg/BatteryState. (Null is what the robot does not measure.)
--
-- @since 0.1.0.0
data BatteryState = BatteryState
  { voltage :: Maybe Double
  -- ^ In volts.
  , percentage :: Maybe Double
  -- ^ From 0 to 1.
  , charging :: Bool
  -- ^ Whether the charger is connected, and charges it.
  }
  deriving (Eq, Show)

instance RosMessage BatteryState where
  messageType _ = "sensor_msgs/msg/BatteryState"
  fromRos = withObject "BatteryState" $ \o ->
    BatteryState
      <$> entry o "voltage"
      <*> entry o "percentage"
      <*> ((== (1 :: Word8)) <$> entry o "power_supply_status")
  toRos state =
    object
      [ "voltage" .= toRos (voltage state)
      , "percentage" .= toRos (percentage state)
      , "power_supply_status" .= toRos (if charging state then 1 else 2 :: Word8)
      ]
