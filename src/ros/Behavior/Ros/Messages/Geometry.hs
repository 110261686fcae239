{-# LANGUAGE FlexibleInstances #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- Messages of geometry_msgs. Lengths are in metres, angles in radians. Its names are short: import it qualified.
--
-- > import qualified Behavior.Ros.Messages.Geometry as Geometry
module Behavior.Ros.Messages.Geometry
  ( -- * Points and directions
    Vector3 (..)
  , Point (..)
  , Quaternion (..)
  , facing
  , yaw

    -- * Places and movements
  , Pose (..)
  , Twist (..)
  , Transform (..)

    -- * With more about them
  , Stamped (..)
  , WithCovariance (..)
  , at
  ) where

import Data.Aeson (Object, Value, object, withObject, (.=))
import qualified Data.Aeson.Key as Key
import Data.Aeson.Types (Parser)
import Data.Text (Text)

import Behavior.Ros.Internal.Message
import Behavior.Ros.Messages (Header (..), Time (..))

-- | Three numbers: geometry_msgs/msg/Vector3.
--
-- @since 0.1.0.0
data Vector3 = Vector3 {x :: Double, y :: Double, z :: Double}
  deriving (Eq, Show)

instance RosMessage Vector3 where
  messageType _ = "geometry_msgs/msg/Vector3"
  fromRos = withObject "Vector3" $ \o -> Vector3 <$> entry o "x" <*> entry o "y" <*> entry o "z"
  toRos (Vector3 a b c) = object ["x" .= toRos a, "y" .= toRos b, "z" .= toRos c]

-- | A point: geometry_msgs/msg/Point.
--
-- @since 0.1.0.0
newtype Point = Point {coordinates :: Vector3}
  deriving (Eq, Show)

instance RosMessage Point where
  messageType _ = "geometry_msgs/msg/Point"
  fromRos = fmap Point . fromRos
  toRos = toRos . coordinates

-- | A direction: geometry_msgs/msg/Quaternion, its x, y, z and w.
--
-- @since 0.1.0.0
data Quaternion = Quaternion Double Double Double Double
  deriving (Eq, Show)

instance RosMessage Quaternion where
  messageType _ = "geometry_msgs/msg/Quaternion"
  fromRos = withObject "Quaternion" $ \o -> Quaternion <$> entry o "x" <*> entry o "y" <*> entry o "z" <*> entry o "w"
  toRos (Quaternion a b c d) = object ["x" .= toRos a, "y" .= toRos b, "z" .= toRos c, "w" .= toRos d]

-- | The direction of a robot on the ground that is turned by this angle, counterclockwise; 0 is along x.
--
-- >>> facing 0
-- Quaternion 0.0 0.0 0.0 1.0
--
-- @since 0.1.0.0
facing :: Double -> Quaternion
facing angle = Quaternion 0 0 (sin (angle / 2)) (cos (angle / 2))

-- | By which angle it is turned around the vertical axis, from -pi to pi.
--
-- > yaw (facing angle)  =  angle     -- from -pi to pi
--
-- >>> round (1000 * yaw (facing 1.5))
-- 1500
--
-- @since 0.1.0.0
yaw :: Quaternion -> Double
yaw (Quaternion a b c d) = atan2 (2 * (d * c + a * b)) (1 - 2 * (b * b + c * c))

-- | A place and a direction: geometry_msgs/msg/Pose.
--
-- @since 0.1.0.0
data Pose = Pose {position :: Point, orientation :: Quaternion}
  deriving (Eq, Show)

instance RosMessage Pose where
  messageType _ = "geometry_msgs/msg/Pose"
  fromRos = withObject "Pose" $ \o -> Pose <$> entry o "position" <*> entry o "orientation"
  toRos (Pose p q) = object ["position" .= toRos p, "orientation" .= toRos q]

-- | A velocity, in metres and radians a second: geometry_msgs/msg/Twist.
--
-- @since 0.1.0.0
data Twist = Twist {linear :: Vector3, angular :: Vector3}
  deriving (Eq, Show)

instance RosMessage Twist where
  messageType _ = "geometry_msgs/msg/Twist"
  fromRos = withObject "Twist" $ \o -> Twist <$> entry o "linear" <*> entry o "angular"
  toRos (Twist l a) = object ["linear" .= toRos l, "angular" .= toRos a]

-- | From one frame of coordinates to another: geometry_msgs/msg/Transform.
--
-- @since 0.1.0.0
data Transform = Transform {translation :: Vector3, rotation :: Quaternion}
  deriving (Eq, Show)

instance RosMessage Transform where
  messageType _ = "geometry_msgs/msg/Transform"
  fromRos = withObject "Transform" $ \o -> Transform <$> entry o "translation" <*> entry o "rotation"
  toRos (Transform t r) = object ["translation" .= toRos t, "rotation" .= toRos r]

-- | With a header: PoseStamped, for example.
--
-- @since 0.1.0.0
data Stamped a = Stamped {header :: Header, content :: a}
  deriving (Eq, Show)

instance RosMessage (Stamped Point) where
  messageType _ = "geometry_msgs/msg/PointStamped"
  fromRos = withObject "PointStamped" (stamped "point")
  toRos = fromStamped "point"

instance RosMessage (Stamped Vector3) where
  messageType _ = "geometry_msgs/msg/Vector3Stamped"
  fromRos = withObject "Vector3Stamped" (stamped "vector")
  toRos = fromStamped "vector"

instance RosMessage (Stamped Pose) where
  messageType _ = "geometry_msgs/msg/PoseStamped"
  fromRos = withObject "PoseStamped" (stamped "pose")
  toRos = fromStamped "pose"

instance RosMessage (Stamped Twist) where
  messageType _ = "geometry_msgs/msg/TwistStamped"
  fromRos = withObject "TwistStamped" (stamped "twist")
  toRos = fromStamped "twist"

instance RosMessage (Stamped (WithCovariance Pose)) where
  messageType _ = "geometry_msgs/msg/PoseWithCovarianceStamped"
  fromRos = withObject "PoseWithCovarianceStamped" (stamped "pose")
  toRos = fromStamped "pose"

instance RosMessage (Stamped (WithCovariance Twist)) where
  messageType _ = "geometry_msgs/msg/TwistWithCovarianceStamped"
  fromRos = withObject "TwistWithCovarianceStamped" (stamped "twist")
  toRos = fromStamped "twist"

stamped :: RosMessage a => Text -> Object -> Parser (Stamped a)
stamped name o = Stamped <$> entry o "header" <*> entry o name

fromStamped :: RosMessage a => Text -> Stamped a -> Value
fromStamped name (Stamped h a) = object ["header" .= toRos h, Key.fromText name .= toRos a]

-- | With the covariance of its six numbers, row by row: 36 numbers.
--
-- @since 0.1.0.0
data WithCovariance a = WithCovariance {estimate :: a, covariance :: [Double]}
  deriving (Eq, Show)

instance RosMessage (WithCovariance Pose) where
  messageType _ = "geometry_msgs/msg/PoseWithCovariance"
  fromRos = withObject "PoseWithCovariance" (withCovariance "pose")
  toRos = fromWithCovariance "pose"

instance RosMessage (WithCovariance Twist) where
  messageType _ = "geometry_msgs/msg/TwistWithCovariance"
  fromRos = withObject "TwistWithCovariance" (withCovariance "twist")
  toRos = fromWithCovariance "twist"

withCovariance :: RosMessage a => Text -> Object -> Parser (WithCovariance a)
withCovariance name o = WithCovariance <$> entry o name <*> entry o "covariance"

fromWithCovariance :: RosMessage a => Text -> WithCovariance a -> Value
fromWithCovariance name (WithCovariance a numbers) =
  object [Key.fromText name .= toRos a, "covariance" .= toRos numbers]

-- | A pose on the ground, in this frame of coordinates: its place, and the angle by which the robot is turned. (Its
-- time is 0: the newest transform counts.)
--
-- > kitchen = at "map" (3, 1.5) 0
--
-- @since 0.1.0.0
at :: Text -> (Double, Double) -> Double -> Stamped Pose
at frame (a, b) angle = Stamped (Header (Time 0 0) frame) (Pose (Point (Vector3 a b 0)) (facing angle))
