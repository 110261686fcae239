{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE FlexibleInstances #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- How messages are read and written.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Message
  ( RosMessage (..)
  , entry
  , entryOr
  , decoded
  , expectedFrom
  , inFull
  , textOf
  ) where

import Control.DeepSeq (NFData, force)
import Control.Exception (evaluate, throwIO)
import Data.Aeson (FromJSON, Object, Value (..), encode, parseJSON, toJSON)
import qualified Data.Aeson.Key as Key
import Data.Aeson.Types (Parser, explicitParseField, explicitParseFieldMaybe', parseEither)
import qualified Data.ByteString.Lazy as Bytes
import Data.Int (Int16, Int32, Int64, Int8)
import Data.Maybe (fromMaybe)
import Data.Proxy (Proxy)
import Data.Text (Text)
import qualified Data.Text as Text
import Data.Text.Encoding (decodeUtf8With)
import Data.Text.Encoding.Error (lenientDecode)
import Data.Word (Word16, Word32, Word64, Word8)

import Behavior (Behavior, Seconds)
import Behavior.Ros.Internal.Error (RosFault (Undecodable))

-- | A type of messages, or of a part of one.
--
-- > data Odometer = Odometer { metres :: Double, note :: Maybe Double }
-- >
-- > instance RosMessage Odometer where
-- >   messageType _ = "my_robot/msg/Odometer"
-- >   fromRos = withObject "Odometer" $ \o -> Odometer <$> entry o "metres" <*> entry o "note"
-- >   toRos (Odometer m n) = object ["metres" .= toRos m, "note" .= toRos n]
--
-- A number that may be null (JSON has no NaN and no infinity, and bridges write null for them) is a 'Maybe'
-- 'Double', which 'Behavior.Ros.measured' takes apart; for a 'Double' null is refused. (An instance of aeson reads
-- null as NaN, which compares with everything as false.) Messages of which there is no instance are read as 'Value'.
--
-- @since 0.1.0.0
class RosMessage a where
  -- | The type's name. If it is empty, the default, the bridge takes the one that the topic has. (Goals, results and
  -- parts of messages need none.)
  messageType :: Proxy a -> Text
  messageType _ = ""

  -- | Reads it.
  fromRos :: Value -> Parser a

  -- | Writes it.
  toRos :: a -> Value

-- | The entry of a message with that name.
--
-- @since 0.1.0.0
entry :: RosMessage a => Object -> Text -> Parser a
entry o = explicitParseField fromRos o . Key.fromText

-- | The entry of a message with that name, or this value where the message has no such entry. (Definitions of messages
-- grow from one distribution of ROS to the next.)
--
-- @since 0.1.0.0
entryOr :: RosMessage a => a -> Object -> Text -> Parser a
entryOr absent o name = fromMaybe absent <$> explicitParseFieldMaybe' fromRos o (Key.fromText name)

-- | What it is, or why it is not.
decoded :: RosMessage a => Value -> Either String a
decoded = parseEither fromRos

-- | What came from this source, if it is what is expected; otherwise the fault 'Undecodable'. It is read here: in the
-- caller's thread and masking state. (In a transaction that would depend on GHC's optimization: an expression that
-- gives a transaction may be evaluated before that runs.)
expectedFrom :: RosMessage a => String -> Value -> Behavior a
expectedFrom source value = evaluate (decoded value) >>= either (throwIO . Undecodable source) pure

-- | All of it, with what the user's code throws in it: here, and not in the link's thread that sends it.
inFull :: NFData a => a -> Behavior a
inFull = evaluate . force

-- | What a server says about what it has not done.
textOf :: Value -> String
textOf said = case said of
  String text -> Text.unpack text
  _ -> Text.unpack (decodeUtf8With lenientDecode (Bytes.toStrict (encode said)))

instance RosMessage Value where
  fromRos = pure
  toRos = id

-- | Of an empty message.
instance RosMessage () where
  fromRos _ = pure ()
  toRos () = Object mempty

instance RosMessage Double where
  fromRos value = case value of
    Number _ -> plain value
    Null -> fail "null for a number (a number that may be null is a Maybe Double)"
    _ -> fail "this is no number"
  toRos x = if isNaN x || isInfinite x then Null else toJSON x

-- | A duration that is a number. (Most of ROS's durations have two parts: 'Behavior.Ros.Messages.Time'.)
instance RosMessage Seconds where
  fromRos value = realToFrac <$> (fromRos value :: Parser Double)
  toRos s = toRos (realToFrac s :: Double)

-- | Nothing is null.
instance RosMessage a => RosMessage (Maybe a) where
  fromRos Null = pure Nothing
  fromRos value = Just <$> fromRos value
  toRos = maybe Null toRos

instance RosMessage a => RosMessage [a] where
  fromRos value = parseJSON value >>= traverse fromRos
  toRos = toJSON . map toRos

instance RosMessage Bool where
  fromRos = plain
  toRos = toJSON

instance RosMessage Text where
  fromRos = plain
  toRos = toJSON

instance RosMessage Int where
  fromRos = plain
  toRos = toJSON

instance RosMessage Int8 where
  fromRos = plain
  toRos = toJSON

instance RosMessage Int16 where
  fromRos = plain
  toRos = toJSON

instance RosMessage Int32 where
  fromRos = plain
  toRos = toJSON

instance RosMessage Int64 where
  fromRos = plain
  toRos = toJSON

instance RosMessage Word8 where
  fromRos = plain
  toRos = toJSON

instance RosMessage Word16 where
  fromRos = plain
  toRos = toJSON

instance RosMessage Word32 where
  fromRos = plain
  toRos = toJSON

instance RosMessage Word64 where
  fromRos = plain
  toRos = toJSON

plain :: FromJSON a => Value -> Parser a
plain = parseJSON
