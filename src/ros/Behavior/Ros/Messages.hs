{-# LANGUAGE FlexibleInstances #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- Some of the messages that ROS 2 has: those of std_msgs and builtin_interfaces. More are in
-- "Behavior.Ros.Messages.Geometry", "Behavior.Ros.Messages.Sensor", "Behavior.Ros.Messages.Navigation" and
-- "Behavior.Ros.Messages.Test". Others are read as 'Data.Aeson.Value', or are instances of 'RosMessage' of your own.
--
-- Floating-point numbers that a robot may not know are a 'Maybe': a bridge writes null for NaN, and for infinity.
module Behavior.Ros.Messages
  ( -- * std_msgs
    Std (..)
  , Header (..)

    -- * builtin_interfaces
  , Time (..)
  , toSeconds
  , fromSeconds

    -- * Arrays of bytes
  , Bytes (..)
  ) where

import Data.Aeson (Value (..), object, withObject, (.=))
import Data.Aeson.Types (Parser, parseFail)
import Data.ByteString (ByteString)
import qualified Data.ByteString as ByteString
import qualified Data.ByteString.Base64 as Base64
import Data.Int (Int32, Int64)
import Data.Text (Text)
import Data.Text.Encoding (decodeLatin1, encodeUtf8)
import Data.Word (Word32)

import Behavior (Seconds)
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

-- | A point in time, or a duration: builtin_interfaces/msg/Time and Duration. (ROS 1 has other names for its parts.)
--
-- @since 0.1.0.0
data Time = Time
  { sec :: Int32
  , nanosec :: Word32
  -- ^ Less than 1,000,000,000.
  }
  deriving (Eq, Ord, Show)

instance RosMessage Time where
  messageType _ = "builtin_interfaces/msg/Time"
  fromRos = withObject "Time" $ \o -> Time <$> entry o "sec" <*> entry o "nanosec"
  toRos (Time s n) = object ["sec" .= s, "nanosec" .= n]

-- |
-- >>> toSeconds (Time (-2) 500000000)
-- -1.5
--
-- @since 0.1.0.0
toSeconds :: Time -> Seconds
toSeconds (Time s n) = fromIntegral s + fromIntegral n / 1e9

-- | To the nearest nanosecond; what is too large is the largest.
--
-- >>> fromSeconds (-1.5)
-- Time {sec = -2, nanosec = 500000000}
--
-- @since 0.1.0.0
fromSeconds :: Seconds -> Time
fromSeconds s = Time (fromInteger whole) (fromInteger rest)
 where
  (whole, rest) = round (max (-2147483648) (min 2147483647 s) * 1e9) `divMod` (1000000000 :: Integer)

-- | When, and in which frame of coordinates, something was measured: std_msgs/msg/Header.
--
-- @since 0.1.0.0
data Header = Header
  { stamp :: Time
  , frameId :: Text
  }
  deriving (Eq, Show)

instance RosMessage Header where
  messageType _ = "std_msgs/msg/Header"
  fromRos = withObject "Header" $ \o -> Header <$> entry o "stamp" <*> entry o "frame_id"
  toRos (Header time frame) = object ["stamp" .= toRos time, "frame_id" .= frame]

-- | An array of bytes (@uint8[]@, @byte[]@), which bridges write in base64. (A list of numbers is read, too.)
--
-- @since 0.1.0.0
newtype Bytes = Bytes {unBytes :: ByteString}
  deriving (Eq, Ord, Show)

instance RosMessage Bytes where
  fromRos value = case value of
    String text -> either (parseFail . ("no base64: " ++)) (pure . Bytes) (Base64.decode (encodeUtf8 text))
    _ -> Bytes . ByteString.pack <$> fromRos value
  toRos = String . decodeLatin1 . Base64.encode . unBytes
