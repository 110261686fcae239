{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- What the program publishes for the robot.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Publication
  ( Publication
  , publication
  , untypedPublication
  , keepingLast
  , publishing
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (ErrorCall (..), bracket_, mask, throwIO)
import Control.Monad (when)
import Data.Aeson (Value)
import qualified Data.Map.Strict as Map
import Data.Proxy (Proxy (..))
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Behavior)
import Behavior.Ros.Internal.Frame (Request (..))
import Behavior.Ros.Internal.Link
import Behavior.Ros.Internal.Message
import Behavior.STM (atomically)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Ros
-- >>> import Behavior.Ros.Fake
-- >>> import Behavior.Ros.Messages
-- >>> import Behavior.STM (atomically)
-- >>> import Behavior.Sim (simulate)
-- >>> import Control.Monad (void)

-- | A topic on which the program publishes.
--
-- @since 0.1.0.0
data Publication a = Publication
  { nameOf :: Text
  , typeOf :: Text
  , keepsLast :: Bool
  }

-- | The topic with that name.
--
-- > velocity = publication "/cmd_vel" :: Publication Twist
--
-- @since 0.1.0.0
publication :: forall a. RosMessage a => String -> Publication a
publication name = Publication (Text.pack name) (messageType (Proxy :: Proxy a)) False

-- | The topic with that name and type, whose messages are JSON.
--
-- > buzzer = untypedPublication "/buzzer" "my_robot/msg/Melody"
--
-- @since 0.1.0.0
untypedPublication :: String -> String -> Publication Value
untypedPublication name typeName = Publication (Text.pack name) (Text.pack typeName) False

-- | The same topic, whose last message the bridge keeps for those who subscribe later. (ROS 1 calls that latched, ROS 2
-- transient local.)
--
-- @since 0.1.0.0
keepingLast :: Publication a -> Publication a
keepingLast which = which {keepsLast = True}

-- | Runs a behaviour that is given how to publish on a topic.
--
-- > publishing ros velocity $ \publish -> every 0.1 (publish (forwards 0.2)) `finally` publish stillness
--
-- The topic is advertised until the behaviour has ended, and again after each loss of the link. Nothing says that a
-- message has been received: for some tenths of a second after the topic was advertised, messages are lost. So
-- what moves by a stream of messages needs a watchdog on the robot, which stops it when the stream ends: a loss of
-- the link ends it, too.
--
-- While there is no link, publishing waits: nothing is kept to be sent later. ('Behavior.Time.timeout' limits how old
-- a message may be when it is sent.)
--
-- [Result] The behaviour's. Publishing returns when the message has been handed to the link.
-- [Failure] The behaviour's; publishing fails with 'Behavior.Ros.NoServer', if there is no link within
--   'Behavior.Ros.noServerAfter'.
-- [Fault] The behaviour's. A type without a name is refused with an 'ErrorCall', and so is a topic that the program
--   publishes with another type already.
-- [Cancellation] Passes through.
--
-- >>> :{
-- void . simulate . withFakeRobot [] $ \robot -> withRos (fakeRos robot) $ \ros -> do
--   publishing ros (publication "/speed") $ \say -> say (Std (Just 0.2)) >> sleep 1 >> say (Std (Just 0))
--   sleep 1
--   atomically (seen robot) >>= mapM_ print
-- :}
-- (0.0,Connected)
-- (0.0,Advertised "/speed")
-- (0.0,Published "/speed" (Object (fromList [("data",Number 0.2)])))
-- (1.0,Published "/speed" (Object (fromList [("data",Number 0.0)])))
-- (1.0,Unadvertised "/speed")
--
-- @since 0.1.0.0
publishing :: RosMessage a => Ros -> Publication a -> ((a -> Behavior ()) -> Behavior b) -> Behavior b
publishing ros which behavior = do
  _ <- inFull (name, typeOf which)
  when (Text.null (typeOf which)) . throwIO . ErrorCall $
    "publishing: " ++ Text.unpack name ++ " needs the name of its type (messageType, or untypedPublication)"
  bracket_ (atomically (begin ros which {nameOf = name})) (atomically (finish ros name)) (behavior publish)
 where
  name = absolute ros (nameOf which)
  publish message = do
    written <- inFull (toRos message)
    mask $ \restore -> handOver ros restore (ask ros (Publish name written))

-- | One more publisher.
begin :: Ros -> Publication a -> STM ()
begin ros which = do
  known <- readTVar (advertised ros)
  next <- case Map.lookup (nameOf which) known of
    Nothing -> new <$ whenUp ros (Advertise (nameOf which) (typeOf which) (keepsLast which))
    Just (Advertised typeName keeps n)
      | typeName == typeOf which && keeps == keepsLast which -> pure (Advertised typeName keeps (n + 1))
      | otherwise ->
          throwSTM . ErrorCall $
            "publishing: " ++ Text.unpack (nameOf which) ++ " is published already, as " ++ Text.unpack typeName
  writeTVar (advertised ros) (Map.insert (nameOf which) next known)
 where
  new = Advertised (typeOf which) (keepsLast which) 1

-- | One publisher less.
finish :: Ros -> Text -> STM ()
finish ros name = do
  known <- readTVar (advertised ros)
  case Map.lookup name known of
    Just (Advertised typeName keeps n)
      | n > 1 -> writeTVar (advertised ros) (Map.insert name (Advertised typeName keeps (n - 1)) known)
      | otherwise -> do
          writeTVar (advertised ros) (Map.delete name known)
          -- (It does not wait: nothing interrupts it, and a bridge that takes nothing may never do so.)
          whenUp ros (Unadvertise name) `orElse` pure ()
    Nothing -> pure ()

-- | Asks the bridge, if there is a link. (Otherwise there is nothing to ask: a new connection advertises what is left.)
whenUp :: Ros -> Request -> STM ()
whenUp ros request = readTVar (link ros) >>= \l -> when (isUp l) (ask ros request)
