{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- What a robot's own server sends to a reader of its live page. A robot may be slow, silent or hostile: what it can
-- make this reader keep, and for how long it is waited for, is bounded.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Reading
  ( Address
  , parseAddress
  , reading
  ) where

import Control.Exception (Handler (..), IOException, bracket, bracketOnError, catches, try)
import Control.Monad (when)
import qualified Data.ByteString as Strict
import qualified Data.ByteString.Char8 as Char8
import qualified Data.ByteString.Lazy as Bytes
import Data.Char (isDigit)
import Data.Foldable (traverse_)
import Data.IORef
import Data.List (stripPrefix)
import Data.Text (Text)
import Data.Text.Encoding (decodeUtf8')
import GHC.IO.Exception (IOException (..))
import Network.HTTP.Types (urlDecode)
import Network.Socket hiding (socket)
import Network.Socket.ByteString (recv)
import Network.Socket.ByteString.Lazy (sendAll)
import Network.WebSockets (ConnectionOptions (..), SizeLimit (..), defaultConnectionOptions)
import qualified Network.WebSockets as Websockets
import Network.WebSockets.Stream (makeStream)
import System.Timeout (timeout)

import Behavior.Internal.Loopback (isLoopback)
import Behavior.Live.Internal.Protocol

-- | Where a robot's own server is: its host, its port, and the token of its page.
data Address = Address String String (Maybe Text)
  deriving (Eq, Show)

-- | The address of a live page, as its robot prints it; or what is wrong with it. Only this machine is allowed, for
-- nothing on the way is encrypted, and so no address makes a hub send anything to another one.
--
-- >>> parseAddress "http://127.0.0.1:8420/#a%20secret"
-- Right (Address "127.0.0.1" "8420" (Just "a secret"))
-- >>> either (const "refused") (const "allowed") (parseAddress "http://evil.example:8420/")
-- "refused"
parseAddress :: String -> Either String Address
parseAddress given = case stripPrefix "http://" given of
  Just rest
    | (place, path) <- break (`elem` ("/#" :: String)) rest
    , Just (host, port) <- hostAndPort place
    , Just token <- tokenIn (dropWhile (== '/') (take 1 path) ++ drop 1 path) ->
        if isLoopback host
          then Right (Address host port token)
          else Left "it is not on this machine; allowed: 127.0.0.1, ::1 or localhost (use a tunnel: ssh -L)"
  _ -> Left "an address is http://HOST:PORT/ or http://HOST:PORT/#TOKEN"
 where
  hostAndPort place = case place of
    '[' : six | (host, ']' : ':' : port) <- break (== ']') six -> numbered host port
    _ | (host, ':' : port) <- break (== ':') place -> numbered host port
    _ -> Nothing
  numbered host port
    | not (null port), length port <= 5, all isDigit port, (read port :: Int) <= 65535 = Just (host, port)
    | otherwise = Nothing
  tokenIn text = case text of
    "" -> Just Nothing
    '#' : token -> either (const Nothing) (Just . Just) (decodeUtf8' (urlDecode True (Char8.pack token)))
    _ -> Nothing

-- | The most bytes of a message; and of the answer to the handshake.
mostInMessage, mostInHandshake :: Int
mostInMessage = 16 * 1024 * 1024
mostInHandshake = 64 * 1024

-- | For how long a robot is waited for, in microseconds: until it is connected, and then for each message. (A page
-- waits for as long: a beat should have come after 0.7 s, and ten seconds later it tries another connection.)
patience :: Int
patience = 10700000

-- | Reads a robot's messages: the action is given what receives the next one. (What the reader wants has no token: that
-- of the robot is shown.) The result is why there are no more of them; an exception of another kind is the action's.
reading :: Address -> Attach -> (IO Bytes.ByteString -> IO a) -> IO (Either String a)
reading (Address host port token) wanted use =
  (Right <$> bracket connected close attached)
    `catches` [ Handler $ \e -> pure (Left (ioe_description (e :: IOException)))
              , Handler $ \e -> pure . Left $ case e of
                  Websockets.ParseException why -> "what it says is no websocket's: " ++ why
                  _ -> "the connection has ended"
              , Handler $ \e -> pure . Left $ case e of
                  Websockets.MalformedResponse response _ ->
                    "the status of its answer is " ++ show (Websockets.responseCode response)
                  _ -> "what it answers is no websocket"
              ]
 where
  attached socket = do
    came <- newIORef 0
    most <- newIORef mostInHandshake
    stream <- makeStream (limited most came socket) (traverse_ (sendAll socket))
    Websockets.runClientWithStream stream authority "/live" options [("Origin", origin)] $ \connection -> do
      writeIORef most mostInMessage
      Websockets.sendTextData connection (attachMessage wanted {shownToken = token})
      use (inTime (Websockets.receiveData connection) <* writeIORef came 0)
  authority = (if ':' `elem` host then "[" ++ host ++ "]" else host) ++ ":" ++ port
  origin = Char8.pack ("http://" ++ authority)
  options =
    defaultConnectionOptions
      { connectionFramePayloadSizeLimit = SizeLimit (fromIntegral mostInMessage)
      , connectionMessageDataSizeLimit = SizeLimit (fromIntegral mostInMessage)
      }
  connected = getAddrInfo (Just defaultHints {addrSocketType = Stream}) (Just host) (Just port) >>= firstThatConnects
  -- (A name may have two addresses.)
  firstThatConnects found = case found of
    [] -> ioError (userError "it has no address")
    [address] -> connectedTo address
    address : others -> tried (connectedTo address) >>= either (const (firstThatConnects others)) pure
  tried act = try act :: IO (Either IOException Socket)
  connectedTo address = bracketOnError (openSocket address) close $ \socket -> do
    setSocketOption socket NoDelay 1
    socket <$ inTime (connect socket (addrAddress address))

inTime :: IO a -> IO a
inTime act = timeout patience act >>= maybe (ioError (userError "it says nothing")) pure

-- | Receives, and counts the bytes since the last message: many fragments that are empty are too much, as well.
limited :: IORef Int -> IORef Int -> Socket -> IO (Maybe Strict.ByteString)
limited most came socket = do
  bytes <- inTime (recv socket 32768)
  modifyIORef' came (+ Strict.length bytes)
  isTooMuch <- (>) <$> readIORef came <*> readIORef most
  when isTooMuch . ioError $ userError "it says more than a message may have"
  pure (if Strict.null bytes then Nothing else Just bytes)
