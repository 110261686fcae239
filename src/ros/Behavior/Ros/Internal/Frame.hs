{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The frames of rosbridge v2: what is asked of a bridge, and what it answers.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Frame
  ( -- * What is asked
    Request (..)
  , encodeRequest
  , decodeRequest

    -- * What is answered
  , Answer (..)
  , encodeAnswer
  , decodeAnswer

    -- * Limits
  , Limits (..)
  , tooLarge
  , Id
  ) where

import Control.Monad (when)
import Data.Aeson (Object, Value (..), eitherDecode', encode, object, withObject, (.!=), (.:), (.:?), (.=))
import Data.Aeson.Types (Parser, parseEither)
import Data.Bifunctor (first)
import qualified Data.ByteString.Lazy as Bytes
import Data.Text (Text)

import Behavior.Internal.Nesting (hasMoreDigitsThan, nestsDeeperThan)

-- | What distinguishes a goal of ours from the others of this link.
type Id = Text

-- | A frame to the bridge.
data Request
  = -- | Topic and type (empty: the one that the topic has).
    Subscribe Text Text
  | Unsubscribe Text
  | -- | Action, type, goal.
    SendGoal Id Text Text Value
  | CancelGoal Id Text
  | -- | Topic, type, and whether the bridge is to keep the last message for new subscribers.
    Advertise Text Text Bool
  | Unadvertise Text
  | Publish Text Value
  | -- | Service, type (empty: the one that the service has), request.
    CallService Id Text Text Value
  deriving (Eq, Show)

-- | A frame from the bridge.
data Answer
  = Message Text Value
  | Feedback Id Value
  | -- | The status of the goal: 4 succeeded, 5 cancelled, 6 aborted, 0 it was never accepted.
    Result Id Int Value
  | -- | The answer of a service, and whether it could answer.
    Response Id Bool Value
  | -- | What the bridge complains about, and of which request.
    Complaint (Maybe Id) Text
  | -- | One that we do not use.
    Other Text
  deriving (Eq, Show)

-- | What a frame may be at most.
data Limits = Limits
  { mostBytes :: !Int
  , mostDepth :: !Int
  -- ^ How deep its brackets nest.
  }

-- | The frame, for the bridge.
encodeRequest :: Request -> Bytes.ByteString
encodeRequest request = encode . object $ case request of
  Subscribe t typeName -> ["op" .= op "subscribe", "id" .= subscription t, "topic" .= t] ++ optional typeName
  Unsubscribe t -> ["op" .= op "unsubscribe", "id" .= subscription t, "topic" .= t]
  SendGoal n action typeName arguments ->
    [ "op" .= op "send_action_goal"
    , "id" .= n
    , "action" .= action
    , "action_type" .= typeName
    , "args" .= arguments
    , "feedback" .= True
    ]
  CancelGoal n action -> ["op" .= op "cancel_action_goal", "id" .= n, "action" .= action]
  Advertise t typeName latch ->
    ["op" .= op "advertise", "id" .= advertisement t, "topic" .= t, "type" .= typeName, "latch" .= latch]
  Unadvertise t -> ["op" .= op "unadvertise", "id" .= advertisement t, "topic" .= t]
  Publish t message -> ["op" .= op "publish", "topic" .= t, "msg" .= message]
  CallService n service typeName arguments ->
    ["op" .= op "call_service", "id" .= n, "service" .= service, "args" .= arguments] ++ optional typeName
 where
  optional typeName = ["type" .= typeName | typeName /= ""]
  subscription t = "subscription of " <> t
  advertisement t = "advertisement of " <> t

-- | How a bridge reads it.
decodeRequest :: Limits -> Bytes.ByteString -> Either String Request
decodeRequest limits = decodeFrame limits $ \o name -> case name of
  "subscribe" -> Subscribe <$> o .: "topic" <*> o .:? "type" .!= ""
  "unsubscribe" -> Unsubscribe <$> o .: "topic"
  "send_action_goal" -> SendGoal <$> o .: "id" <*> o .: "action" <*> o .: "action_type" <*> o .:? "args" .!= Null
  "cancel_action_goal" -> CancelGoal <$> o .: "id" <*> o .: "action"
  "advertise" -> Advertise <$> o .: "topic" <*> o .: "type" <*> o .:? "latch" .!= False
  "unadvertise" -> Unadvertise <$> o .: "topic"
  "publish" -> Publish <$> o .: "topic" <*> o .: "msg"
  "call_service" -> CallService <$> o .: "id" <*> o .: "service" <*> o .:? "type" .!= "" <*> o .:? "args" .!= Null
  _ -> fail ("no request: op " ++ show name)

-- | The frame of a bridge.
encodeAnswer :: Answer -> Bytes.ByteString
encodeAnswer answer = encode . object $ case answer of
  Message t message -> ["op" .= op "publish", "topic" .= t, "msg" .= message]
  Feedback n values -> ["op" .= op "action_feedback", "id" .= n, "values" .= values]
  -- (The field "result" of a cancelled goal is true for one bridge, and false for another. Here it is true.)
  Result n status values ->
    ["op" .= op "action_result", "id" .= n, "status" .= status, "values" .= values, "result" .= (status /= 6)]
  Response n can values -> ["op" .= op "service_response", "id" .= n, "values" .= values, "result" .= can]
  Complaint n why -> ["op" .= op "status", "level" .= op "error", "msg" .= why] ++ ["id" .= i | Just i <- [n]]
  Other name -> ["op" .= name]

-- | (For the type of a literal.)
op :: Text -> Text
op = id

-- | The answer in a frame, or why there is none.
decodeAnswer :: Limits -> Bytes.ByteString -> Either String Answer
decodeAnswer limits = decodeFrame limits $ \o name -> case name of
  "publish" -> Message <$> o .: "topic" <*> o .: "msg"
  "action_feedback" -> Feedback <$> o .: "id" <*> o .: "values"
  "action_result" -> do
    status <- o .: "status"
    when (status `notElem` [0, 4, 5, 6 :: Int]) $ fail ("a result with the status " ++ show status)
    Result <$> o .: "id" <*> pure status <*> o .:? "values" .!= Null
  "service_response" -> Response <$> o .: "id" <*> o .: "result" <*> o .:? "values" .!= Null
  "status" -> do
    level <- o .:? "level" .!= "error"
    if level == op "error" then Complaint <$> o .:? "id" <*> o .:? "msg" .!= "" else pure (Other name)
  _ -> pure (Other name)

decodeFrame :: Limits -> (Object -> Text -> Parser a) -> Bytes.ByteString -> Either String a
decodeFrame limits fields frame = do
  let bytes = fromIntegral (Bytes.length frame)
  when (bytes > mostBytes limits) (Left (tooLarge bytes (mostBytes limits)))
  -- Before it is parsed: a parser needs hundreds of bytes for each bracket.
  when (nestsDeeperThan (mostDepth limits) frame) . Left $
    "a frame that nests deeper than " ++ show (mostDepth limits)
  -- (No 'Double' has more, however it is written.)
  when (hasMoreDigitsThan 1100 frame) (Left "a number of more than 1100 digits")
  value <- first ("a frame that is no JSON: " ++) (eitherDecode' frame)
  first ("a frame that rosbridge does not have: " ++) $
    parseEither (withObject "a frame" (\o -> o .: "op" >>= fields o)) value

-- | What is said of a frame with this number of bytes, and of how many are allowed.
tooLarge :: Int -> Int -> String
tooLarge bytes allowed = "a frame of " ++ show bytes ++ " bytes; allowed: " ++ show allowed
