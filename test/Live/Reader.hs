{-# LANGUAGE OverloadedStrings #-}

-- |
-- A reader of a live page, over a socket of this machine.
module Live.Reader
  ( -- * Connections
    reading
  , readingAt
  , attachedBy
  , plainly
  , local
  , freePort
  , reachable
  , withConnection
  , unlessClosed

    -- * Messages
  , next
  , nextOfAny
  , message
  , field
  , followBy
  , events
  , eventsIn
  ) where

import Control.Concurrent (yield)
import Control.Exception (Handler (..), IOException, bracket, catches, evaluate, onException, try)
import Control.Monad (forM_)
import Data.Aeson (Value, eitherDecode, encode, object, (.=))
import qualified Data.Aeson.Key as Key
import Data.Aeson.Types (FromJSON, parseMaybe, withObject, (.:))
import qualified Data.ByteString.Char8 as Char8
import Data.Maybe (fromMaybe)
import Data.Text (Text)
import qualified Data.Text as Text
import GHC.Clock (getMonotonicTimeNSec)
import Network.Socket
import qualified Network.WebSockets as Websockets
import System.IO.Error (isResourceVanishedError)
import Test.Hspec (shouldBe, shouldReturn)

import Behavior.Trace
import Behavior.Trace.Format (decodeEvent)

-- | What a browser of this machine sends.
local :: Int -> Websockets.Headers
local port = [("Origin", Char8.pack ("http://127.0.0.1:" ++ show port))]

-- | What a reader says that knows nothing yet.
plainly :: Value
plainly = object ["version" .= (1 :: Int)]

-- | Over a connection that has attached itself so.
reading :: Int -> Value -> (Websockets.Connection -> IO a) -> IO a
reading = readingAt "/live"

-- | The same of the websocket with this path.
readingAt :: String -> Int -> Value -> (Websockets.Connection -> IO a) -> IO a
readingAt path port = attachedAt path port (local port)

-- | With these headers.
attachedBy :: Int -> Websockets.Headers -> Value -> (Websockets.Connection -> IO a) -> IO a
attachedBy = attachedAt "/live"

attachedAt :: String -> Int -> Websockets.Headers -> Value -> (Websockets.Connection -> IO a) -> IO a
attachedAt path port headers said use =
  withConnection port $ \s ->
    Websockets.runClientWithSocket s host path Websockets.defaultConnectionOptions others $ \connection ->
      Websockets.sendTextData connection (encode said) >> use connection
 where
  host = maybe ("127.0.0.1:" ++ show port) Char8.unpack (lookup "Host" headers)
  others = filter ((/= "Host") . fst) headers

-- | The next message; and the next that is no beat.
nextOfAny, next :: Websockets.Connection -> IO Value
nextOfAny connection = Websockets.receiveData connection >>= either fail pure . eitherDecode
next connection = nextOfAny connection >>= \m -> if message m == "beat" then next connection else pure m

-- | Its kind.
message :: Value -> String
message = Text.unpack . field "message"

-- | What it has there.
field :: FromJSON a => Text -> Value -> a
field name = fromMaybe (error ("no field " ++ show name)) . parseMaybe (withObject "message" (.: Key.fromText name))

-- | The next messages are of these kinds.
followBy :: [String] -> Websockets.Connection -> IO ()
followBy kinds connection = forM_ kinds $ \kind -> message <$> next connection `shouldReturn` kind

-- | This number of events, as they come.
events :: Websockets.Connection -> Int -> IO [Event]
events connection n
  | n <= 0 = pure []
  | otherwise = do
      m <- next connection
      message m `shouldBe` "events"
      (eventsIn "events" m ++) <$> events connection (n - length (eventsIn "events" m))

-- | The events that it has there.
eventsIn :: Text -> Value -> [Event]
eventsIn name m = map (either (error . show) id . decodeEvent . encode) (field name m :: [Value])

-- | A port that is free, and none of those from which the system takes one for each connection: one of those may be
-- another's before there is a server.
freePort :: IO Int
freePort = do
  time <- getMonotonicTimeNSec
  let port = 10000 + fromIntegral (time `div` 1024 `mod` 20000)
      free = bracket (socket AF_INET Stream defaultProtocol) close (`bind` onLoopback port)
  try free >>= either (\e -> evaluate (e :: IOException) >> freePort) (const (pure port))

onLoopback :: Int -> SockAddr
onLoopback port = SockAddrInet (fromIntegral port) (tupleToHostAddress (127, 0, 0, 1))

-- | Again until there is a server.
reachable :: Int -> IO a -> IO a
reachable port act = try (withConnection port (const (pure ()))) >>= either again (const act)
 where
  again e = evaluate (e :: IOException) >> yield >> reachable port act

-- | Over a connection.
withConnection :: Int -> (Socket -> IO a) -> IO a
withConnection port = bracket open close
 where
  open = do
    s <- socket AF_INET Stream defaultProtocol
    connect s (onLoopback port) `onException` close s
    pure s

-- | 'Nothing': the connection was closed. (Of one that is closed before all has been read, the system says that it was
-- reset.)
unlessClosed :: IO a -> IO (Maybe a)
unlessClosed act =
  (Just <$> act) `catches`
    [ Handler $ \e -> Nothing <$ evaluate (e :: Websockets.ConnectionException)
    , Handler $ \e -> if isResourceVanishedError e then pure Nothing else ioError e
    ]
