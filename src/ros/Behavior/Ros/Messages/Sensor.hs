{-# LANGUAGE OverloadedStrings #-}

-- |
-- Messages of sensor_msgs.
module Behavior.Ros.Messages.Sensor
  ( BatteryState (..)
  , LaserScan (..)
  , nearest
  ) where

import Data.Aeson (object, withObject, (.=))
import Data.Word (Word8)

import Behavior (Seconds)
import Behavior.Ros.Internal.Message
import Behavior.Ros.Messages (Header)

-- $setup
-- >>> import Behavior.Ros.Messages
-- >>> import Data.Text (pack)

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

-- | A scan by a laser: sensor_msgs/msg/LaserScan. Angles are in radians, counterclockwise, 0 is ahead; distances are in
-- metres. A distance is 'Nothing' where the laser has met nothing, or has not measured: a bridge does not say which.
--
-- @since 0.1.0.0
data LaserScan = LaserScan
  { scanHeader :: Header
  , angleMin :: Double
  -- ^ Of the first distance.
  , angleMax :: Double
  -- ^ Of the last one.
  , angleIncrement :: Double
  -- ^ Between two.
  , timeIncrement :: Seconds
  -- ^ Between two.
  , scanTime :: Seconds
  -- ^ Between two scans.
  , rangeMin :: Double
  -- ^ What is nearer does not count.
  , rangeMax :: Maybe Double
  -- ^ What is farther does not count.
  , ranges :: [Maybe Double]
  , intensities :: [Maybe Double]
  -- ^ Empty, if the laser has none.
  }
  deriving (Eq, Show)

instance RosMessage LaserScan where
  messageType _ = "sensor_msgs/msg/LaserScan"
  fromRos = withObject "LaserScan" $ \o ->
    LaserScan
      <$> entry o "header"
      <*> entry o "angle_min"
      <*> entry o "angle_max"
      <*> entry o "angle_increment"
      <*> entry o "time_increment"
      <*> entry o "scan_time"
      <*> entry o "range_min"
      <*> entry o "range_max"
      <*> entry o "ranges"
      <*> entry o "intensities"
  toRos scan =
    object
      [ "header" .= toRos (scanHeader scan)
      , "angle_min" .= toRos (angleMin scan)
      , "angle_max" .= toRos (angleMax scan)
      , "angle_increment" .= toRos (angleIncrement scan)
      , "time_increment" .= toRos (timeIncrement scan)
      , "scan_time" .= toRos (scanTime scan)
      , "range_min" .= toRos (rangeMin scan)
      , "range_max" .= toRos (rangeMax scan)
      , "ranges" .= toRos (ranges scan)
      , "intensities" .= toRos (intensities scan)
      ]

-- | The smallest distance between 'rangeMin' and 'rangeMax' at an angle between these; 'Nothing', if none was measured.
--
-- > obstacle = (< 0.5) \<$\> measured (nearest (-0.5) 0.5) (latest ros scan)
--
-- (So a robot whose laser meets nothing, or has gone blind, has no nearest obstacle: the signal faults. Where nothing
-- within reach is a usual situation, say so: @maybe True (> 0.5) . nearest (-0.5) 0.5@.)
--
-- >>> let scan = LaserScan (Header (Time 0 0) (pack "laser")) (-1) 1 0.5 0 0.1 0.1 (Just 10)
-- >>> nearest (-0.6) 1 (scan [Just 0.3, Just 2, Nothing, Just 0.05, Just 20] [])
-- Just 2.0
--
-- @since 0.1.0.0
nearest :: Double -> Double -> LaserScan -> Maybe Double
nearest from to scan = if null valid then Nothing else Just (minimum valid)
 where
  valid = [d | (angle, Just d) <- zip angles (ranges scan), angle >= from, angle <= to, inReach d]
  angles = [angleMin scan + fromIntegral i * angleIncrement scan | i <- [0 :: Int ..]]
  inReach d = d >= rangeMin scan && maybe True (d <=) (rangeMax scan)
