{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The server of a live page. It only shows: no message of a reader changes anything in the mission.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Server
  ( application
  ) where

import Control.Concurrent.Async (race_)
import Control.Concurrent.STM
import Control.Exception (bracket_, handle, throwIO)
import Control.Monad (forever, unless, void, when)
import qualified Data.ByteString as Strict
import qualified Data.ByteString.Lazy as Bytes
import qualified Data.ByteString.Lazy.Char8 as Char8
import Data.Foldable (traverse_)
import Data.IORef
import Data.Maybe (isJust)
import Data.Text (Text)
import qualified Data.Text as Text
import GHC.Clock (getMonotonicTime)
import Network.HTTP.Types
import Network.Wai
import Network.Wai.Handler.WebSockets (getRequestHead, isWebSocketsReq, runWebSockets)
import Network.WebSockets (ConnectionOptions (..), SizeLimit (..), defaultConnectionOptions)
import qualified Network.WebSockets as Websockets
import System.Timeout (timeout)

import Behavior.Internal.Nesting (nestsDeeperThan)
import Behavior.Live.Internal.Access
import Behavior.Live.Internal.History
import Behavior.Live.Internal.Page
import Behavior.Live.Internal.Protocol
import Behavior.Live.Internal.Shown

-- | The page, and the websocket of its readers.
application :: Shown -> Application
application shown request respond = case forbidden of
  Just why -> respond (refused status403 why)
  Nothing
    | isWebSocketsReq request, pathInfo request == ["live"] -> respond reader
    | isWebSocketsReq request -> respond (refused status404 "the websocket is /live")
    | requestMethod request `notElem` ["GET", "HEAD"] -> respond (refused status405 "allowed: GET")
    | otherwise -> respond (maybe (refused status404 "there is no such file") file (pageFile (pathInfo request)))
 where
  header name = lookup name (requestHeaders request)
  forbidden
    | onlyHere shown, Just why <- refusedHost (header "Host") = Just why
    | isWebSocketsReq request = refusedOrigin (isJust (token shown)) (header "Host") (header "Origin")
    | otherwise = Nothing
  reader = flip responseRaw (refused status404 "this is for websockets") $ \source sink -> do
    said <- newIORef 0
    answered <- newIORef True
    let options = readerOptions {connectionOnPong = writeIORef answered True}
    runWebSockets options (getRequestHead request) (accepting shown answered) (bounded said source) (inTime sink)
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
accepting :: Shown -> IORef Bool -> Websockets.ServerApp
accepting shown answered waiting = handle gone $ do
  connection <- Websockets.acceptRequest waiting
  let say = Websockets.sendTextData connection
      refuse why = say (refusal why) >> ending connection
      ping = do
        isThere <- readIORef answered
        unless isThere (throwIO Websockets.ConnectionClosed)
        writeIORef answered False
        Websockets.sendPing connection ("" :: Text)
  bracket_ (counted (+ 1)) (counted (subtract 1)) $ do
    many <- readTVarIO (readers shown)
    first <- timeout 5000000 (Websockets.receiveData connection)
    case if many > mostReaders then Left tooMany else maybe (Left "nothing was said for 5 s") attach first of
      Left why -> refuse why
      Right wanted ->
        race_ (Websockets.receiveDataMessage connection) (telling shown say ping wanted >> ending connection)
 where
  gone :: Websockets.ConnectionException -> IO ()
  gone _ = pure ()
  counted f = atomically (modifyTVar' (readers shown) f)
  tooMany = "there are " ++ show mostReaders ++ " readers, which is the most"
  attach bytes
    | nestsDeeperThan 10 bytes = Left "it nests too deep"
    | otherwise = readAttach bytes >>= permitted
  permitted wanted
    | wantedVersion wanted /= protocolVersion =
        Left ("version " ++ show (wantedVersion wanted) ++ " of the protocol; allowed: " ++ show protocolVersion)
    | Just secret <- token shown
    , maybe True (not . isToken secret) (shownToken wanted) =
        Left "the token is another one"
    | otherwise = Right wanted
  -- (It ends when the reader has read all, and closes it, too.)
  ending connection = do
    Websockets.sendClose connection ("" :: Text)
    void (timeout 1000000 (forever (Websockets.receiveDataMessage connection)))

-- Sends a reader all that comes; with each sixteenth beat, some five seconds, a ping.
telling :: Shown -> (Bytes.ByteString -> IO ()) -> IO () -> Attach -> IO ()
telling shown say ping wanted = do
  say (hello (run shown))
  begun <- readTVarIO (history shown)
  cursor <- case knownUntil wanted of
    Just (known, n) | known == Text.pack (runName (run shown)), Just _ <- chunksFrom n begun -> pure n
    _ -> whole begun
  follow (0 :: Int) 0 cursor
 where
  -- How many beats there were, when the next one is due, and the number of the event to tell next.
  follow beats due cursor = do
    t <- getMonotonicTime
    if t < due then waiting (due - t) cursor >>= maybe (pure ()) (follow beats due) else do
      atTime beat =<< readTVarIO (history shown)
      when (beats `mod` 16 == 0) ping
      follow (beats + 1) (t + 0.3) cursor
  -- Sends what comes in that time; then the next number, or nothing if all is over.
  waiting time cursor = do
    _ <- timeout (ceiling (1000000 * time)) . atomically $ do
      next <- nextNumber <$> readTVar (history shown)
      complete <- readTVar (isComplete shown)
      check (next /= cursor || complete)
    (after, complete) <- atomically ((,) <$> readTVar (history shown) <*> readTVar (isComplete shown))
    next <- case chunksFrom cursor after of
      Just new -> nextNumber after <$ traverse_ (say . eventsMessage) new
      Nothing -> whole after
    if complete then Nothing <$ atTime over after else pure (Just next)
  whole current = nextNumber current <$ atTime snapshotMessage current
  atTime message current = clock shown current >>= \t -> say (message t current)
