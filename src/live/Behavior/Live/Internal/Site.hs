{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- A server that only shows: files, and websockets for readers, which it protects itself from.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Site
  ( Site (..)
  , Telling
  , application
  ) where

import Control.Concurrent.Async (race_)
import Control.Concurrent.STM
import Control.Exception (bracket_, handle, throwIO)
import Control.Monad (forever, unless, void)
import qualified Data.ByteString as Strict
import qualified Data.ByteString.Lazy as Bytes
import qualified Data.ByteString.Lazy.Char8 as Char8
import Data.IORef
import Data.Maybe (isJust)
import Data.Text (Text)
import Network.HTTP.Types
import Network.Wai
import Network.Wai.Handler.WebSockets (getRequestHead, isWebSocketsReq, runWebSockets)
import Network.WebSockets (ConnectionOptions (..), SizeLimit (..), defaultConnectionOptions)
import qualified Network.WebSockets as Websockets
import System.Timeout (timeout)

import Behavior.Internal.Nesting (nestsDeeperThan)
import Behavior.Live.Internal.Access
import Behavior.Live.Internal.Protocol

-- | What it has, and for whom.
data Site = Site
  { onlyForHere :: Bool
  -- ^ Whether only this machine reaches it.
  , secret :: Maybe Text
  -- ^ What a reader must show.
  , fileAt :: [Text] -> Maybe (Strict.ByteString, Strict.ByteString)
  -- ^ The type and the content of the file with this path.
  , tellingAt :: [Text] -> Maybe Telling
  -- ^ What the websocket with this path sends.
  , connected :: TVar Int
  -- ^ How many readers there are.
  }

-- | All that a reader receives: given what sends a message, what sends a ping (to be called every five seconds, and not
-- more often: it ends the connection if the last one was not answered), and what the reader wants.
type Telling = (Bytes.ByteString -> IO ()) -> IO () -> Attach -> IO ()

-- | The files, and the websockets of the readers.
application :: Site -> Application
application site request respond = case forbidden of
  Just why -> respond (refused status403 why)
  Nothing
    | isWebSocketsReq request ->
        respond (maybe (refused status404 "there is no such websocket") reader (tellingAt site (pathInfo request)))
    | requestMethod request `notElem` ["GET", "HEAD"] -> respond (refused status405 "allowed: GET")
    | otherwise -> respond (maybe (refused status404 "there is no such file") file (fileAt site (pathInfo request)))
 where
  header name = lookup name (requestHeaders request)
  forbidden
    | onlyForHere site, Just why <- refusedHost (header "Host") = Just why
    | isWebSocketsReq request = refusedOrigin (isJust (secret site)) (header "Host") (header "Origin")
    | otherwise = Nothing
  reader telling = flip responseRaw (refused status404 "this is for websockets") $ \source sink -> do
    said <- newIORef 0
    answered <- newIORef True
    let options = readerOptions {connectionOnPong = writeIORef answered True}
        server = accepting site telling answered
    runWebSockets options (getRequestHead request) server (bounded said source) (inTime sink)
  file (kind, content) = responseLBS status200 ((hContentType, kind) : always) (Bytes.fromStrict content)
  refused status why =
    responseLBS status ((hContentType, "text/plain; charset=utf-8") : always) (Char8.pack (why ++ "\n"))

readerOptions :: ConnectionOptions
readerOptions = defaultConnectionOptions
  { connectionFramePayloadSizeLimit = SizeLimit 4096
  , connectionMessageDataSizeLimit = SizeLimit 4096
  }

-- The bytes that a reader says: at most 256 KiB in all, which is enough to answer pings for days.
bounded :: IORef Int -> IO Strict.ByteString -> IO Strict.ByteString
bounded said source = do
  bytes <- source
  modifyIORef' said (+ Strict.length bytes)
  n <- readIORef said
  if n > 262144 then throwIO Websockets.ConnectionClosed else pure bytes

-- What is sent: a reader that takes nothing for five seconds is cut.
inTime :: (Strict.ByteString -> IO ()) -> Strict.ByteString -> IO ()
inTime sink bytes = case Strict.splitAt 65536 bytes of
  (some, rest) -> do
    timeout 5000000 (sink some) >>= maybe (throwIO Websockets.ConnectionClosed) pure
    unless (Strict.null rest) (inTime sink rest)

-- The page loads nothing from elsewhere, and is in no frame of another one.
always :: ResponseHeaders
always =
  [ ( "Content-Security-Policy"
    , "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; base-uri 'none'; \
      \form-action 'none'; frame-ancestors 'none'"
    )
  , ("X-Content-Type-Options", "nosniff")
  , ("Referrer-Policy", "no-referrer")
  , ("Cross-Origin-Resource-Policy", "same-origin")
  , (hCacheControl, "no-store")
  ]

-- | The greatest number of readers at a time.
mostReaders :: Int
mostReaders = 32

-- One that does not say in time what it wants, says anything more, or does not read, is cut. (That it is gone is no
-- error.)
accepting :: Site -> Telling -> IORef Bool -> Websockets.ServerApp
accepting site telling answered waiting = handle gone $ do
  connection <- Websockets.acceptRequest waiting
  let say = Websockets.sendTextData connection
      refuse why = say (refusal why) >> ending connection
      ping = do
        isThere <- readIORef answered
        unless isThere (throwIO Websockets.ConnectionClosed)
        writeIORef answered False
        Websockets.sendPing connection ("" :: Text)
  bracket_ (counted (+ 1)) (counted (subtract 1)) $ do
    many <- readTVarIO (connected site)
    first <- timeout 5000000 (Websockets.receiveData connection)
    case if many > mostReaders then Left tooMany else maybe (Left "nothing was said for 5 s") attach first of
      Left why -> refuse why
      Right wanted ->
        race_ (Websockets.receiveDataMessage connection) (telling say ping wanted >> ending connection)
 where
  gone :: Websockets.ConnectionException -> IO ()
  gone _ = pure ()
  counted f = atomically (modifyTVar' (connected site) f)
  tooMany = "there are " ++ show mostReaders ++ " readers, which is the most"
  attach bytes
    | nestsDeeperThan 10 bytes = Left "it nests too deep"
    | otherwise = readAttach bytes >>= permitted
  permitted wanted
    | wantedVersion wanted /= protocolVersion =
        Left ("version " ++ show (wantedVersion wanted) ++ " of the protocol; allowed: " ++ show protocolVersion)
    | Just right <- secret site
    , maybe True (not . isToken right) (shownToken wanted) =
        Left "the token is another one"
    | otherwise = Right wanted
  -- (It ends when the reader has read all, and closes it, too.)
  ending connection = do
    Websockets.sendClose connection ("" :: Text)
    void (timeout 1000000 (forever (Websockets.receiveDataMessage connection)))
