{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE FlexibleContexts #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}
{-# LANGUAGE TypeFamilies #-}

-- |
-- Calls of a robot's services.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Call
  ( RosService (..)
  , Service
  , service
  , untypedService
  , call
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (finally, mask, throwIO)
import Data.Aeson (Value)
import qualified Data.Map.Strict as Map
import Data.Proxy (Proxy (..))
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Behavior, (?))
import Behavior.Ros.Internal.Error
import Behavior.Ros.Internal.Frame (Request (CallService))
import Behavior.Ros.Internal.Link
import Behavior.Ros.Internal.Message
import Behavior.Ros.Internal.Options
import Behavior.STM (atomically)
import Behavior.Time (timeout)
import Behavior.Trace (named)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Ros
-- >>> import Behavior.Ros.Fake
-- >>> import Behavior.Ros.Messages
-- >>> import Behavior.Sim (simulate)
-- >>> import Behavior.Time (now)
-- >>> import Control.Monad (void)

-- | A type of services.
--
-- > data SetBool
-- >
-- > instance RosService SetBool where
-- >   type Question SetBool = Std Bool
-- >   type Answer SetBool = Outcome
-- >   serviceType _ = "std_srvs/srv/SetBool"
--
-- @since 0.1.0.0
class (RosMessage (Question a), RosMessage (Answer a)) => RosService a where
  -- | What it is asked: the request.
  type Question a

  -- | What it answers: the response.
  type Answer a

  -- | The type's name. (If it is empty, the bridge takes the one that the service has.)
  serviceType :: Proxy a -> Text

-- | A service without a type of its own: see 'untypedService'.
instance RosService Value where
  type Question Value = Value
  type Answer Value = Value
  serviceType _ = Text.empty

-- | A service of a robot: a server that answers at once.
--
-- @since 0.1.0.0
data Service a = Service Text Text

-- | The service with that name.
--
-- > lights = service "/lights" :: Service SetBool
--
-- @since 0.1.0.0
service :: forall a. RosService a => String -> Service a
service name = Service (Text.pack name) (serviceType (Proxy :: Proxy a))

-- | The service with that name and type, whose requests and responses are JSON.
--
-- > lights = untypedService "/lights" "std_srvs/srv/SetBool"
--
-- @since 0.1.0.0
untypedService :: String -> String -> Service Value
untypedService name typeName = Service (Text.pack name) (Text.pack typeName)

-- | Calls a service, and waits for its answer.
--
-- ROS cannot cancel a call: one that was interrupted, or was too slow, /may still run on the robot/, also after the
-- next branch has begun. What takes time, or moves something, belongs into an action ("Behavior.Ros.Action").
--
-- [Result] The service's answer.
-- [Failure] 'ServiceFailed', if there is no such service, or it could not answer; 'TooSlow', if it has not answered
--   within 'Behavior.Ros.tooSlowAfter'; 'NoServer', if there is no link within 'Behavior.Ros.noServerAfter'.
-- [Fault] 'LinkLost' at once when the link is lost; 'Undecodable' if the answer is not what is expected.
-- [Cancellation] Returns at once. An answer that comes later is ignored.
--
-- >>> :{
-- void . simulate . withFakeRobot [] $ \robot -> withRos (fakeRos robot) $ \ros -> do
--   offerService robot "/lights" (answering 0.2)
--   call ros (untypedService "/lights" "std_srvs/srv/SetBool") (toRos (Std True)) >>= print
--   now >>= print
-- :}
-- Object (fromList [])
-- 0.2
--
-- @since 0.1.0.0
call :: RosService a => Ros -> Service a -> Question a -> Behavior (Answer a)
call ros (Service relative typeName) question = named ("call: " ++ name) $ do
  (_, _, message) <- inFull (there, typeName, toRos question)
  mask $ \restore -> do
    (n, reply) <- handOver ros restore (asking message)
    (restore (answerTo reply) `finally` atomically (modifyTVar' (calls ros) (Map.delete n))) >>= \case
      Just (Answered values) -> restore (expectedFrom name values)
      Just (Refused why) -> throwIO (ServiceFailed name (textOf why))
      Just NoReply -> atomically (readTVar (link ros) >>= throwSTM . LinkLost (robot ros) . whyLost)
      Nothing -> throwIO (TooSlow name limit)
 where
  name = Text.unpack there
  there = absolute ros relative
  limit = tooSlowAfter (rosOptions ros)
  answerTo reply = timeout limit (Just <$> atomically (readTVar reply >>= maybe retry pure)) ? pure Nothing
  asking message = do
    n <- newId ros (Text.pack "call")
    reply <- newTVar Nothing
    ask ros (CallService n there typeName message)
    modifyTVar' (calls ros) (Map.insert n reply)
    pure (n, reply)
