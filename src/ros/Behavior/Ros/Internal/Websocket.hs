{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Frames over a websocket.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Websocket
  ( rosbridge
  , rosbridgeAnywhere
  ) where

import Control.Monad (guard)
import qualified Data.ByteString.Lazy as Bytes
import Data.Char (isDigit)
import Data.List (isPrefixOf, stripPrefix)
import Network.WebSockets (ConnectionOptions (..), SizeLimit (..), defaultConnectionOptions)
import qualified Network.WebSockets as Websockets
import Text.Read (readMaybe)

import Behavior.Ros.Internal.Transport

-- | A bridge that speaks rosbridge v2 (rosbridge_suite, for example) on this machine.
--
-- > rosbridge "ws://127.0.0.1:9090"
--
-- Every program that reaches a bridge can move the robot, and nothing on the way is protected. So other machines than
-- this one are refused with an 'Control.Exception.ErrorCall' (a fault) by 'Behavior.Ros.withRos': use a tunnel, or
-- 'rosbridgeAnywhere'. There is no @wss@ yet.
--
-- @since 0.1.0.0
rosbridge :: String -> Transport
rosbridge = toBridge $ \host ->
  if host `elem` ["localhost", "::1"] || ("127." `isPrefixOf` host && all (`elem` "0123456789.") host)
    then Nothing
    else Just ("it is not on this machine; allowed: 127.0.0.1, ::1 and localhost (or rosbridgeAnywhere), not " ++ host)

-- | 'rosbridge' on any machine, over a network in which you trust everyone.
--
-- @since 0.1.0.0
rosbridgeAnywhere :: String -> Transport
rosbridgeAnywhere = toBridge (const Nothing)

toBridge :: (String -> Maybe String) -> String -> Transport
toBridge refused url = case parts url of
  Nothing ->
    Transport
      { address = url
      , refusal = Just ("rosbridge: an address is ws://HOST:PORT or ws://HOST:PORT/PATH, not " ++ show url)
      , connecting = \_ _ _ -> ioError (userError "no address")
      }
  Just (host, port, path) ->
    Transport
      { address = url
      , refusal = ("rosbridge: " ++) <$> refused host
      , connecting = \bytes received use ->
          Websockets.runClientWith host port path (limited bytes received) [] $ \connection ->
            use
              Connection
                { receiveFrame = Websockets.receiveData connection
                , sendFrame = Websockets.sendTextData connection
                , sendPing = Websockets.sendPing connection Bytes.empty
                }
      }
 where
  -- A larger frame is refused by the link, which goes on; one that is larger than this ends the connection, before it
  -- is all in memory.
  limited bytes received =
    let most = SizeLimit (fromIntegral (max bytes 20000000))
    in defaultConnectionOptions
        { connectionOnPong = received
        , connectionFramePayloadSizeLimit = most
        , connectionMessageDataSizeLimit = most
        }

-- | Host, port and path of an address.
parts :: String -> Maybe (String, Int, String)
parts url = do
  rest <- stripPrefix "ws://" url
  let (authority, path) = break (== '/') rest
  (host, port) <- case authority of
    '[' : six -> case break (== ']') six of
      (h, ']' : ':' : p) -> Just (h, p)
      _ -> Nothing
    _ -> case break (== ':') authority of
      (h, ':' : p) -> Just (h, p)
      _ -> Nothing
  guard (not (null host) && not (null port) && all isDigit port)
  number <- readMaybe port
  guard (number <= 65535)
  pure (host, number, if null path then "/" else path)
