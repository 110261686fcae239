{-# LANGUAGE OverloadedStrings #-}

-- |
-- The live page over a socket of this machine.
module Live.ServerSpec (spec) where

import Control.Concurrent.Async (concurrently, mapConcurrently, wait, withAsync)
import Control.Concurrent.STM
import Control.Exception (catch)
import Control.Monad (forM_, replicateM_, (>=>))
import Data.Aeson (Value (..), encode, object, (.=))
import Data.Bifunctor (bimap)
import qualified Data.ByteString.Char8 as Char8
import qualified Data.ByteString.Lazy as Bytes
import Data.List (isInfixOf, isPrefixOf)
import Data.Text (Text)
import qualified Data.Text as Text
import Data.Time.Clock.POSIX (posixSecondsToUTCTime)
import Network.Socket hiding (listen)
import Network.Socket.ByteString (recv, sendAll)
import Network.Wai.Handler.Warp (testWithApplication)
import qualified Network.WebSockets as Websockets
import System.Timeout (timeout)
import Test.Hspec hiding (before)

import Behavior.Live
import Behavior.Live.Internal.History (Limits (..), defaultLimits, lostSoFar, nextNumber)
import Behavior.Live.Internal.Protocol
import Behavior.Live.Internal.Server (application)
import Behavior.Live.Internal.Shown hiding (pending)
import Behavior.Time (now)
import Behavior.Trace
import Live.Reader
import Viewer.Examples (interrupted, mission)

spec :: Spec
spec = around_ (timeout 60000000 >=> maybe (expectationFailure "not over after 60 s") pure) $ do
  describe "Access:" $ do
    it "the page is served under this machine's names, and at any port" $ serving Nothing $ \_ port ->
      forM_ ["localhost", "127.0.0.1:" <> Char8.pack (show port), "[::1]:9999", "LOCALHOST:1"] $
        page port >=> (`shouldSatisfy` ("HTTP/1.1 200" `isPrefixOf`))
    it "under another name it is refused" $ serving Nothing $ \_ port ->
      forM_ ["evil.example", "127.0.0.1.evil.example:8420", "localhost.evil.example", "", "localhost:80@evil.example"] $
        page port >=> (`shouldSatisfy` ("HTTP/1.1 403" `isPrefixOf`))
    it "it loads nothing from elsewhere" $ serving Nothing $ \_ port ->
      page port "localhost" >>= (`shouldSatisfy` ("Content-Security-Policy: default-src 'none'" `isInfixOf`))
    it "a web page of another origin reads nothing, nor one without an origin" $ serving Nothing $ \_ port ->
      forM_ ["http://evil.example", "null", "http://localhost:1", "http://127.0.0.1"] $ \origin ->
        attached port [("Origin", origin)] plainly `shouldReturn` Left "403"
    it "without an origin it needs a token" $ serving Nothing $ \_ port ->
      attached port [] plainly `shouldReturn` Left "403"
    it "through a tunnel at another port it is served" $ serving Nothing $ \_ port ->
      firstFrom port [("Host", "localhost:9999"), ("Origin", "http://localhost:9999")] plainly `shouldReturn` "hello"
    it "with a token it is for readers that show it" $ serving (Just "a secret") $ \_ port -> do
      firstFrom port [] (object ["version" .= one, "token" .= ("a secret" :: Text)]) `shouldReturn` "hello"
      forM_ [Nothing, Just "", Just "a secre", Just "a secret2", Just "b secret"] $ \shown ->
        firstFrom port [] (object (("version" .= one) : ["token" .= s | Just s <- [shown :: Maybe Text]]))
          `shouldReturn` "refused"
    it "another version of the protocol is refused, and what is none" $ serving Nothing $ \_ port ->
      forM_ [object ["version" .= (2 :: Int)], Null, object [], String (Text.replicate 3000 "[")] $ \said ->
        firstFrom port (local port) said `shouldReturn` "refused"
    it "more than 4 KiB from a reader end the connection" $ serving Nothing $ \_ port -> do
      gave <- attached port (local port) (object ["version" .= one, "more" .= Text.replicate 5000 "x"])
      gave `shouldBe` Left "closed"

  it "Events that are in hand when the run ends are counted as lost" $ do
    shown <- newShown defaultLimits {mostEvents = 10} ours (const (pure 0)) Nothing True
    let many = interrupted 2000
    withAsync (receive shown many) $ \receiving -> do
      late <- atomically (readTVar (inHand shown) >>= \n -> n <$ check (n > 0 && n < length many))
      finish shown
      wait receiving
      publishing shown
      made <- readTVarIO (history shown)
      (nextNumber made, lostSoFar made) `shouldBe` (length many - late + 1, late)

  describe "A reader" $ do
    it "that comes late is given what runs and what was, and then what comes" $ serving Nothing $ \shown port -> do
      let (before, later) = splitAt 9 mission
      tell shown before
      reading port plainly $ \connection -> do
        ["hello", "snapshot"] `followBy` connection
        tell shown later
        events connection (length later) `shouldReturn` later
    it "that comes back is given what it missed" $ serving Nothing $ \shown port -> do
      tell shown mission
      known <- reading port plainly $ \connection -> (,) <$> next connection <*> next connection
      tell shown (interrupted 20)
      let (name, n) = bimap (field "run") (field "next") known :: (Text, Int)
          said = object ["version" .= one, "run" .= name, "next" .= n]
      reading port said $ \connection -> do
        ["hello"] `followBy` connection
        events connection (length (interrupted 20)) `shouldReturn` interrupted 20
    it "that comes back to another run, or too late, is a new one" . serving Nothing $ \shown port -> do
      tell shown mission
      forM_ [("another" :: Text, 0 :: Int), ("run", -1), ("run", 3), ("run", 100000)] $ \(name, n) ->
        reading port (object ["version" .= one, "run" .= name, "next" .= n]) (["hello", "snapshot"] `followBy`)
    it "learns that the run is over" $ serving Nothing $ \shown port -> do
      tell shown mission
      reading port plainly $ \connection -> do
        finish shown
        ["hello", "snapshot", "over"] `followBy` connection
    it "learns three times a second that the robot is there" $ serving Nothing $ \_ port ->
      reading port plainly $ \connection -> do
        ["hello", "snapshot"] `followBy` connection
        replicateM_ 4 (message <$> nextOfAny connection `shouldReturn` "beat")
    it "that talks is cut" $ serving Nothing $ \_ port ->
      reading port plainly $ \connection -> do
        ["hello", "snapshot"] `followBy` connection
        Websockets.sendTextData connection ("stop the robot" :: Text)
        orWhyNot (message <$> next connection) `shouldReturn` Left "closed"
    it "is one of 32 at most" $ serving Nothing $ \shown port -> do
      full <- newTVarIO (0 :: Int)
      let stays = reading port plainly $ \connection -> do
            ["hello", "snapshot"] `followBy` connection
            atomically (modifyTVar' full (+ 1))
            atomically (readTVar full >>= check . (> 32))
      withAsync (mapConcurrently (const stays) [1 .. 32 :: Int]) $ \_ -> do
        atomically (readTVar full >>= check . (== 32))
        firstFrom port (local port) plainly `shouldReturn` "refused"
        atomically (writeTVar full 33)
      allHaveRead shown
      firstFrom port (local port) plainly `shouldReturn` "hello"
    it "that does not read is cut, and the others go on" $ serving Nothing $ \shown port -> do
      -- (More than the system keeps for a connection.)
      let flood = [Began (Span n Top Named (replicate 900 'x') 0 Nothing) | n <- [1 .. 1000]]
      withConnection port $ \silent -> do
        handshake silent port
        reading port plainly $ \connection -> do
          ["hello", "snapshot"] `followBy` connection
          (_, count) <- concurrently (replicateM_ 10 (tell shown flood)) (countEvents connection (10 * length flood))
          count `shouldBe` 10 * length flood
        atomically (readTVar (readers shown) >>= check . (<= 1))
        allHaveRead shown

  describe "The behaviour" $ do
    it "runs without a page beyond this machine, if there is no token" $
      withLive loopback {pageHost = "0.0.0.0", pagePort = 0} (\receiving -> True <$ receiving mission)
        `shouldReturn` True
    it "has a page at the next port if its own is taken" $
      withLive loopback {pagePort = 18420} $ \_ -> withLive loopback {pagePort = 18420} $ \receiving -> do
        receiving mission
        firstFrom 18421 (local 18421) plainly `shouldReturn` "hello"
    it "is shown to its end" $ do
      ready <- newEmptyTMVarIO
      let behavior = named "wave" (atomically (takeTMVar ready))
      (_, seen) <- concurrently
        (viewing defaultViewing {livePage = Just loopback {pagePort = 18430}} behavior)
        (reachable 18430 $ reading 18430 plainly $ \connection -> do
          atomically (putTMVar ready ())
          untilOver connection)
      seen `shouldSatisfy` any (\m -> "\"name\":\"wave\"" `isInfixOf` m && "\"ended\"" `isInfixOf` m)
    it "has times that are relative to when it began" $ do
      port <- freePort
      withLive loopback {pagePort = port} $ \receiving -> do
        began <- now
        receiving [Began (Span 1 Top Named "wave" began Nothing)]
        times <- reading port plainly $ \connection -> do
          seen <- eventsIn "running" <$> (next connection >> next connection)
          these <- if null seen then events connection 1 else pure seen
          latest <- field "now" <$> nextOfAny connection
          pure (latest : [realToFrac (spanBegan s) | Began s <- these])
        times `shouldSatisfy` all (\t -> t >= 0 && t < (60 :: Double))
 where
  one = 1 :: Int

ours :: Run
ours = Run "Ann" "run" (posixSecondsToUTCTime 0)

-- A page with what is needed for it, and its port.
serving :: Maybe Text -> (Shown -> Int -> IO a) -> IO a
serving secret use = do
  shown <- newShown defaultLimits ours (const (pure 0)) secret True
  withAsync (publishing shown) $ \_ -> testWithApplication (pure (application shown)) (use shown)

-- Returns when they are in chunks.
tell :: Shown -> [Event] -> IO ()
tell shown new = do
  before <- nextNumber <$> readTVarIO (history shown)
  receive shown new
  atomically (readTVar (history shown) >>= check . (>= before + length new) . nextNumber)

-- The kind of the first message, or why there is none.
attached :: Int -> Websockets.Headers -> Value -> IO (Either String String)
attached port headers said = orWhyNot (message <$> attachedBy port headers said next)

-- What comes; or the status of a refused handshake, or that the connection was closed.
orWhyNot :: IO a -> IO (Either String a)
orWhyNot act =
  (maybe (Left "closed") Right <$> unlessClosed act) `catch` \e -> pure . Left $ case e of
    Websockets.MalformedResponse response _ -> show (Websockets.responseCode response)
    other -> show other

firstFrom :: Int -> Websockets.Headers -> Value -> IO String
firstFrom port headers said = either id id <$> attached port headers said

countEvents :: Websockets.Connection -> Int -> IO Int
countEvents connection n
  | n <= 0 = pure 0
  | otherwise = do
      m <- next connection
      let here = if message m == "events" then field "next" m - field "from" m else 0
      (here +) <$> countEvents connection (n - here)

untilOver :: Websockets.Connection -> IO [String]
untilOver connection = do
  m <- next connection
  if message m == "over" then pure [] else (Char8.unpack (Bytes.toStrict (encode m)) :) <$> untilOver connection

-- What the server answers to a request for the page under this name.
page :: Int -> Char8.ByteString -> IO String
page port host = withConnection port $ \s -> do
  sendAll s ("GET / HTTP/1.1\r\nHost: " <> host <> "\r\nConnection: close\r\n\r\n")
  Char8.unpack . mconcat <$> untilClosed s
 where
  untilClosed s = recv s 65536 >>= \bytes -> if Char8.null bytes then pure [] else (bytes :) <$> untilClosed s

-- Attaches itself, and never reads.
handshake :: Socket -> Int -> IO ()
handshake s port = do
  let host = Char8.pack ("127.0.0.1:" ++ show port)
  setSocketOption s RecvBuffer 4096
  sendAll s . mconcat $
    [ "GET /live HTTP/1.1\r\nHost: ", host, "\r\nOrigin: http://", host
    , "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    , "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    ]
  -- (A masked frame, whose mask is zero.)
  let said = Bytes.toStrict (encode (object ["version" .= (1 :: Int)]))
  sendAll s (Char8.pack ['\x81', toEnum (128 + Char8.length said), '\0', '\0', '\0', '\0'] <> said)
