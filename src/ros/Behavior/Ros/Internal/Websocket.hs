{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Frames over a websocket.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Websocket
  ( rosbridge
  , rosbridgeTrusting
  , rosbridgeAnywhere
  ) where

import Control.Applicative ((<|>))
import Control.Concurrent (rtsSupportsBoundThreads)
import Control.Concurrent.STM (TVar, modifyTVar', newTVarIO, readTVar)
import Control.Monad (guard, when)
import qualified Data.ByteString as Strict
import qualified Data.ByteString.Base64 as Base64
import qualified Data.ByteString.Lazy as Bytes
import Data.Char (isDigit)
import Data.Foldable (traverse_)
import Data.IORef
import Data.List (stripPrefix)
import qualified Data.Text as Text
import Data.Text.Encoding (decodeLatin1)
import Network.Socket (Socket)
import Network.Socket.ByteString (recv)
import Network.Socket.ByteString.Lazy (sendAll)
import Network.WebSockets (ConnectionOptions (..), SizeLimit (..), defaultConnectionOptions)
import qualified Network.WebSockets as Websockets
import Network.WebSockets.Stream (makeStream)
import OpenSSL.Random (randBytes)
import Text.Read (readMaybe)

import Behavior.Internal.Loopback (isLoopback)
import Behavior.Ros.Internal.Socket
import Behavior.Ros.Internal.Tls
import Behavior.Ros.Internal.Transport
import Behavior.STM (atomically)

-- | A bridge that speaks rosbridge v2 (rosbridge_suite, for example): on this machine, or on any by an encrypted
-- connection.
--
-- > rosbridge "ws://127.0.0.1:9090"
-- > rosbridge "wss://robot.example.org:9090"
--
-- Every program that reaches a bridge can move the robot. So with @ws@, where nothing on the way is protected, other
-- machines than this one are refused with an 'Control.Exception.ErrorCall' (a fault) by 'Behavior.Ros.withRos': use
-- @wss@, a tunnel, or 'rosbridgeAnywhere'.
--
-- With @wss@ the bridge has to prove, by a certificate that this system trusts, that it is the host. (Give a name: an
-- address of numbers, too, is looked for among the names in the certificate.) Otherwise the link does not come up, and
-- what uses it fails with 'Behavior.Ros.NoServer', which says why. The robot does not check who you are: that is for
-- the network, or for a proxy before the bridge. (The program has to be linked with @-threaded@.)
--
-- While the system asks a name server that does not answer, nothing interrupts it: 'Behavior.Ros.withRos', if it is
-- stopped then, goes on without it after 0.1 s, and reports that as 'Behavior.Time.abandoning' does.
--
-- @since 0.1.0.0
rosbridge :: String -> Transport
rosbridge = toBridge Nothing $ \host ->
  if isLoopback host
    then Nothing
    else Just ("it is not on this machine; allowed: 127.0.0.1, ::1, localhost, wss, or rosbridgeAnywhere; not " ++ host)

-- | 'rosbridge' that trusts the certificates of this file (PEM), and no others: for a bridge that has signed its own.
--
-- > rosbridgeTrusting "robot.pem" "wss://robot.local:9090"
--
-- @since 0.1.0.0
rosbridgeTrusting :: FilePath -> String -> Transport
rosbridgeTrusting certificates = toBridge (Just certificates) $ \_ ->
  Just "certificates are for wss://HOST:PORT or wss://HOST:PORT/PATH"

-- | 'rosbridge' on any machine, also with @ws@: over a network in which you trust everyone.
--
-- @since 0.1.0.0
rosbridgeAnywhere :: String -> Transport
rosbridgeAnywhere = toBridge Nothing (const Nothing)

-- | The file of certificates, what is refused of an address that is not encrypted, and the address.
toBridge :: Maybe FilePath -> (String -> Maybe String) -> String -> Transport
toBridge trusted refused url = case parts url of
  Nothing ->
    Transport
      { address = url
      , refusal = Just ("rosbridge: an address is ws://HOST:PORT or wss://HOST:PORT (and a /PATH), not " ++ show url)
      , newSuffix = pure mempty
      , connecting = \_ _ _ -> ioError (userError "no address")
      }
  Just (isEncrypted, host, port, path) ->
    Transport
      { address = url
      , refusal = ("rosbridge: " ++) <$> if isEncrypted then needsThreads else refused host
      , newSuffix = named <$> randBytes 9
      , connecting = \bytes received use ->
          withSocket host port . (if isEncrypted then withTls trusted host else plainly) $ \receive send -> do
            open <- newIORef False
            came <- newTVarIO 0
            stream <- makeStream (limitedUntil open came receive) send
            let options = limited bytes received
            Websockets.runClientWithStream stream (authority host port) path options [] $ \connection ->
              writeIORef open True >> use (over connection came)
      }
 where
  named bytes = Text.pack " of " <> decodeLatin1 (Base64.encode bytes)
  over connection came =
    Connection
      { receiveFrame = Websockets.receiveData connection
      , bytesCame = readTVar came
      , sendFrame = Websockets.sendTextData connection
      , sendPing = Websockets.sendPing connection Bytes.empty
      , sendClose = Websockets.sendClose connection Bytes.empty
      }
  needsThreads = if rtsSupportsBoundThreads then Nothing else Just "wss needs a program that is linked with -threaded"
  -- A larger frame is refused by the link, which goes on; one that is larger than this ends the connection, before it
  -- is all in memory.
  limited bytes received =
    let most = SizeLimit (fromIntegral (max bytes 20000000))
    in defaultConnectionOptions
        { connectionOnPong = received
        , connectionFramePayloadSizeLimit = most
        , connectionMessageDataSizeLimit = most
        }

-- | Runs the action with what receives from the socket and sends to it.
plainly :: (IO Strict.ByteString -> (Maybe Bytes.ByteString -> IO ()) -> IO a) -> Socket -> IO a
plainly use socket = use (recv socket 32768) (traverse_ (sendAll socket))

-- | Receives, to the end of the connection, and counts the bytes. Until it is open, a bridge has 64 KiB for what it
-- says.
limitedUntil :: IORef Bool -> TVar Int -> IO Strict.ByteString -> IO (Maybe Strict.ByteString)
limitedUntil open came receive = do
  bytes <- receive
  isOpen <- readIORef open
  n <- atomically (modifyTVar' came (+ Strict.length bytes) >> readTVar came)
  when (n > 65536 && not isOpen) . ioError $ userError "its answer to the handshake is longer than 64 KiB"
  pure (if Strict.null bytes then Nothing else Just bytes)

-- | Host and port, as an address has them.
authority :: String -> Int -> String
authority host port = (if ':' `elem` host then "[" ++ host ++ "]" else host) ++ ":" ++ show port

-- | Whether an address is encrypted; its host, port and path.
parts :: String -> Maybe (Bool, String, Int, String)
parts url = do
  (isEncrypted, rest) <- ((,) False <$> stripPrefix "ws://" url) <|> ((,) True <$> stripPrefix "wss://" url)
  let (place, path) = break (== '/') rest
  (host, port) <- case place of
    '[' : six -> case break (== ']') six of
      (h, ']' : ':' : p) -> Just (h, p)
      _ -> Nothing
    _ -> case break (== ':') place of
      (h, ':' : p) -> Just (h, p)
      _ -> Nothing
  guard (not (null host) && not (null port) && all isDigit port)
  number <- readMaybe port
  guard (number <= (65535 :: Integer))
  pure (isEncrypted, host, fromInteger number, if null path then "/" else path)
