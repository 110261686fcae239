{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE TypeFamilies #-}

-- |
-- Parameters of a robot's nodes.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Parameter
  ( ParameterValue (..)
  , getParameter
  , setParameter
  ) where

import Control.Exception (throwIO)
import Control.Monad (unless)
import Data.Aeson (Key, Object, Value, object, withObject, (.=))
import Data.Aeson.Types (Parser)
import Data.Int (Int64)
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Behavior)
import Behavior.Ros.Internal.Call
import Behavior.Ros.Internal.Error
import Behavior.Ros.Internal.Link
import Behavior.Ros.Internal.Message

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Ros
-- >>> import Behavior.Ros.Fake
-- >>> import Behavior.Sim (simulate)
-- >>> import Control.Monad (void)

-- | The value of a parameter.
--
-- @since 0.1.0.0
data ParameterValue
  = BoolValue Bool
  | IntegerValue Int64
  | DoubleValue Double
  | StringValue Text
  | BoolValues [Bool]
  | IntegerValues [Int64]
  | DoubleValues [Double]
  | StringValues [Text]
  deriving (Eq, Show)

-- | The value of a node's parameter.
--
-- > getParameter ros "/controller_server" "controller_frequency"
--
-- [Failure] 'ServiceFailed', if there is no such node or parameter (or it has no value, or it is one of bytes);
--   otherwise as 'call'.
--
-- @since 0.1.0.0
getParameter :: Ros -> String -> String -> Behavior ParameterValue
getParameter ros node name =
  call ros (service (node ++ "/get_parameters") :: Service GetParameters) (Names [Text.pack name]) >>= \case
    Values [Just value] -> pure value
    _ -> throwIO (ServiceFailed node ("there is no parameter " ++ name ++ " with a value"))

-- | Sets a node's parameter.
--
-- > setParameter ros "/controller_server" "controller_frequency" (DoubleValue 10)
--
-- [Failure] 'ServiceFailed', if there is no such node, or it refuses the value (its reason); otherwise as 'call'.
--
-- @since 0.1.0.0
setParameter :: Ros -> String -> String -> ParameterValue -> Behavior ()
setParameter ros node name value = do
  Outcomes outcomes <- call ros (service (node ++ "/set_parameters") :: Service SetParameters) setting
  unless (map fst outcomes == [True]) $
    throwIO (ServiceFailed node ("it does not set " ++ name ++ ": " ++ concatMap (Text.unpack . snd) outcomes))
 where
  setting = Settings [(Text.pack name, value)]

data GetParameters

instance RosService GetParameters where
  type Question GetParameters = Names
  type Answer GetParameters = Values
  serviceType _ = "rcl_interfaces/srv/GetParameters"

data SetParameters

instance RosService SetParameters where
  type Question SetParameters = Settings
  type Answer SetParameters = Outcomes
  serviceType _ = "rcl_interfaces/srv/SetParameters"

newtype Names = Names [Text]

instance RosMessage Names where
  fromRos = withObject "names" $ \o -> Names <$> entry o "names"
  toRos (Names names) = object ["names" .= names]

newtype Values = Values [Maybe ParameterValue]

instance RosMessage Values where
  fromRos = withObject "values" $ \o -> Values <$> (entry o "values" >>= traverse readValue)
  toRos (Values values) = object ["values" .= map (maybe (object ["type" .= (0 :: Int)]) writeValue) values]

newtype Settings = Settings [(Text, ParameterValue)]

instance RosMessage Settings where
  fromRos _ = fail "this is only written"
  toRos (Settings settings) =
    object ["parameters" .= [object ["name" .= name, "value" .= writeValue value] | (name, value) <- settings]]

newtype Outcomes = Outcomes [(Bool, Text)]

instance RosMessage Outcomes where
  fromRos = withObject "results" $ \o -> Outcomes <$> (entry o "results" >>= traverse outcome)
   where
    outcome = withObject "result" $ \o -> (,) <$> entry o "successful" <*> entryOr "" o "reason"
  toRos (Outcomes outcomes) =
    object ["results" .= [object ["successful" .= done, "reason" .= why] | (done, why) <- outcomes]]

-- | rcl_interfaces/msg/ParameterValue: its type says which of its entries counts.
readValue :: Value -> Parser (Maybe ParameterValue)
readValue = withObject "ParameterValue" $ \o -> entry o "type" >>= valueOf o

valueOf :: Object -> Int -> Parser (Maybe ParameterValue)
valueOf o = \case
  1 -> Just . BoolValue <$> entry o "bool_value"
  2 -> Just . IntegerValue <$> entry o "integer_value"
  3 -> Just . DoubleValue <$> entry o "double_value"
  4 -> Just . StringValue <$> entry o "string_value"
  6 -> Just . BoolValues <$> entry o "bool_array_value"
  7 -> Just . IntegerValues <$> entry o "integer_array_value"
  8 -> Just . DoubleValues <$> entry o "double_array_value"
  9 -> Just . StringValues <$> entry o "string_array_value"
  _ -> pure Nothing

writeValue :: ParameterValue -> Value
writeValue = \case
  BoolValue value -> typed 1 "bool_value" value
  IntegerValue value -> typed 2 "integer_value" value
  DoubleValue value -> typed 3 "double_value" value
  StringValue value -> typed 4 "string_value" value
  BoolValues value -> typed 6 "bool_array_value" value
  IntegerValues value -> typed 7 "integer_array_value" value
  DoubleValues value -> typed 8 "double_array_value" value
  StringValues value -> typed 9 "string_array_value" value
 where
  typed :: RosMessage a => Int -> Key -> a -> Value
  typed n name value = object ["type" .= n, name .= toRos value]
