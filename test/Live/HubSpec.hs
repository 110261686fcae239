{-# LANGUAGE OverloadedStrings #-}

-- |
-- The live page of many robots, over sockets of this machine. The robots are servers of live pages, and others that say
-- what the test makes them say.
module Live.HubSpec (spec) where

import Control.Concurrent.Async (concurrently_, link, mapConcurrently_, race_, withAsync)
import Control.Concurrent.STM
import Control.Exception (Handler (..), IOException, bracket, catches, finally)
import Control.Monad (forM_, forever, replicateM_, void, (>=>))
import Data.Aeson (FromJSON, Value (..), eitherDecode, encode, object, toJSON, withObject, (.:), (.=))
import qualified Data.Aeson.Key as Key
import Data.Aeson.Types (parseMaybe)
import qualified Data.ByteString.Char8 as Char8
import qualified Data.ByteString.Lazy as Bytes
import Data.Text (Text)
import qualified Data.Text as Text
import Data.Text.Encoding (encodeUtf8)
import Data.Time.Clock.POSIX (posixSecondsToUTCTime)
import Network.HTTP.Types (urlEncode)
import Network.Socket
import Network.Socket.ByteString (recv, sendAll)
import Network.Wai.Handler.Warp (testWithApplication)
import qualified Network.WebSockets as Websockets
import System.Timeout (timeout)
import Test.Hspec hiding (after, before)

import Behavior.Live.Hub
import Behavior.Live.Internal.History (defaultLimits, nextNumber)
import Behavior.Live.Internal.Known hiding (after)
import Behavior.Live.Internal.Protocol
import Behavior.Live.Internal.Server (application)
import Behavior.Live.Internal.Shown hiding (pending)
import Behavior.Trace hiding (Change, named)
import Live.Reader
import Viewer.Examples (interrupted, mission)

spec :: Spec
spec = around_ (timeout 60000000 >=> maybe (expectationFailure "not over after 60 s") pure) $ do
  describe "Of a robot it" $ do
    it "shows what runs innermost, and the last interruption" $
      robotWith Nothing $ \shown address -> showing [("Ann", address)] $ \_ port -> do
        tell shown mission
        reading port plainly $ \connection -> do
          ann <- only <$> comes connection [("Ann", "live")]
          paths ann `shouldBe` [["mission", "return home"], ["radio"]]
          let it' = field "interruption" ann :: Value
          (field "stopped" it', field "starts" it') `shouldBe` ("survey" :: Text, "recharge" :: Text)
          (field "after" it' :: Double) `shouldSatisfy` (\t -> abs (t - 3.1) < 0.001)
          tell shown (interrupted 20)
          void $ meets connection ((> (20 :: Double)) . field "time" . field "interruption" . only)
    it "shows its last state when it is killed, and that it is back; the others go on" $
      robotWith Nothing $ \shown address -> do
        port' <- freePort
        showing [("Ann", address), ("Bob", at port')] $ \_ port -> reading port plainly $ \connection -> do
          _ <- comes connection [("Ann", "live"), ("Bob", "disconnected")]
          before <- saying port' (forever . beating) $ \_ ->
            row "Bob" <$> comes connection [("Ann", "live"), ("Bob", "live")]
          gone <- row "Bob" <$> comes connection [("Ann", "live"), ("Bob", "disconnected")]
          paths gone `shouldBe` paths before
          paths gone `shouldBe` [["wait", "for the door"]]
          (field "since" gone :: Double) `shouldSatisfy` (> 1.7e12)
          tell shown mission
          _ <- meets connection ((== 2) . length . paths . row "Ann")
          saying port' (forever . beating) $ \_ -> void (comes connection [("Ann", "live"), ("Bob", "live")])
    it "knows that it is silent, and then that it goes on" $ do
      port' <- freePort
      showing [("Bob", at port')] $ \_ port -> reading port plainly $ \connection -> do
        goesOn <- newEmptyTMVarIO
        saying port' (\c -> beating c >> atomically (takeTMVar goesOn) >> forever (beating c)) $ \_ -> do
          _ <- comes connection [("Bob", "live")]
          silent <- only <$> comes connection [("Bob", "disconnected")]
          fieldMaybe "why" silent `shouldBe` (Nothing :: Maybe Text)
          atomically (putTMVar goesOn ())
          void (comes connection [("Bob", "live")])
    it "says that its run is over, and when there is another one" $ do
      port' <- freePort
      showing [("Bob", at port')] $ \_ port -> reading port plainly $ \connection -> do
        saying port' (`say` "{\"message\":\"over\",\"now\":7,\"next\":0,\"lost\":0}") $ \_ ->
          void (comes connection [("Bob", "over")])
        saying port' (forever . beating) $ \_ -> void (comes connection [("Bob", "live")])
    it "shows the token of its page, and not the reader's" $
      robotWith (Just "a secret") $ \_ address -> do
        showing [("Ann", address ++ "#a%20secret"), ("Bob", address), ("Cid", address ++ "#another")] $ \_ port -> do
          reading port plainly $ \connection ->
            void (comes connection [("Ann", "live"), ("Bob", "refused"), ("Cid", "refused")])
          readingAt "/robots/Ann/live" port (object ["version" .= one, "token" .= ("another" :: Text)])
            (["hello", "snapshot"] `followBy`)

  describe "A robot that says what is not allowed is away, and the others are live:" $
    forM_ hostile $ \(what, why, said) -> it what $ robotWith Nothing $ \_ address -> do
      port' <- freePort
      saying port' said $ \_ -> showing [("Ann", address), ("Bob", at port')] $ \_ port ->
        reading port plainly $ \connection -> do
          m <- meets connection $ \m ->
            standings m == [("Ann", "live"), ("Bob", "disconnected")]
              && fieldMaybe "why" (row "Bob" m) == Just (why :: Text)
          paths (row "Bob" m) `shouldBe` [["wait", "for the door"]]

  it "What is no robot is away, and the reason is shown" $
    forM_ [("HTTP/1.1 200 OK\r\n\r\n", "200"), ("hello\r\n\r\n", "no web"), (long, "more than")] $
      \(answer, why) -> do
        port' <- freePort
        ended <- newTVarIO 0
        listeningAt port' (\s -> recv s 4096 >> sendAll s answer) ended . showing [("Bob", at port')] $ \_ port ->
          reading port plainly $ \connection -> do
            bob <- only <$> comes connection [("Bob", "disconnected")]
            fieldMaybe "why" bob `shouldSatisfy` maybe False (Text.isInfixOf why)

  describe "Its robots" $ do
    it "are those that the transaction gives now" $
      robotWith Nothing $ \_ ann -> robotWith Nothing $ \_ bob -> showing [("Ann", ann)] $ \robots port ->
        reading port plainly $ \connection -> do
          _ <- comes connection [("Ann", "live")]
          atomically (writeTVar robots [("Bob", bob), ("Ann", ann)])
          _ <- comes connection [("Ann", "live"), ("Bob", "live")]
          atomically (writeTVar robots [("Bob", bob)])
          _ <- comes connection [("Bob", "live")]
          atomically (writeTVar robots [])
          void (comes connection [])
    it "are left when they are no longer given" $ do
      port' <- freePort
      saying port' (forever . beating) $ \ended -> showing [("Bob", at port')] $ \robots port ->
        reading port plainly $ \connection -> do
          _ <- comes connection [("Bob", "live")]
          atomically (writeTVar robots [])
          atomically (readTVar ended >>= check . (> 0))
    it "are known from before when they have moved" $ do
      port' <- freePort
      robotWith Nothing $ \_ ann -> showing [("Bob", at port')] $ \robots port ->
       reading port plainly $ \connection -> do
        saying port' (forever . beating) $ \_ -> void (comes connection [("Bob", "live")])
        atomically (writeTVar robots [("Bob", "http://localhost:1/")])
        moved <- only <$> comes connection [("Bob", "disconnected")]
        paths moved `shouldBe` [["wait", "for the door"]]
        atomically (writeTVar robots [("Bob", ann)])
        void (comes connection [("Bob", "live")])
    it "are on this machine" $
      forM_ ["http://192.0.2.1:80/", "http://evil.example/", "http://127.0.0.1.evil.example:80/", "ws://[::1]:80", ""] $
        \address -> showing [("Ann", address)] $ \_ port -> reading port plainly $ \connection -> do
          ann <- only <$> comes connection [("Ann", "disconnected")]
          Text.take 9 (field "why" ann) `shouldSatisfy` (`elem` ["an addres", "it is not"])
    it "are 200 at most, and each has a name" $
      showing ([(show n, "") | n <- [1000 .. 1204 :: Int]] ++ [("1000", "another")]) $ \_ port ->
        reading port plainly $ \connection -> do
          m <- meets connection ((== 200) . length . standings)
          field "others" m `shouldBe` (5 :: Int)
    it "have names that are data" $ forM_ ["a/b?c#d", "<img src=x>", "..%2f", "\1234 \ESC[31m", replicate 1000 'x'] $
      \name -> robotWith Nothing $ \shown address -> showing [(name, address)] $ \_ port -> do
        let name' = Text.pack (take 200 name)
            path = "/robots/" <> urlEncode True (encodeUtf8 name') <> "/live"
        tell shown mission
        reading port plainly $ \connection -> void (comes connection [(name', "live")])
        readingAt (Char8.unpack path) port plainly $ \connection ->
          (next connection >> field "next" <$> next connection) `shouldReturn` length mission

  describe "The page of one robot, there," $ do
    it "receives what the robot's own does, and what it has missed" $ robotWith Nothing $ \shown address ->
      showing [("Ann", address)] $ \_ port -> do
        tell shown mission
        _ <- reading port plainly (`comes` [("Ann", "live")])
        known' <- readingAt "/robots/Ann/live" port plainly $ \connection -> do
          begun <- next connection
          snapshot <- next connection
          tell shown (interrupted 20)
          events connection 60 `shouldReturn` interrupted 20
          let (run', n) = (field "run" begun, field "next" snapshot) :: (Text, Int)
          pure (object ["version" .= one, "run" .= run', "next" .= n])
        readingAt "/robots/Ann/live" port known' $ \connection -> do
          ["hello"] `followBy` connection
          events connection 60 `shouldReturn` interrupted 20
          finish shown
          ["over"] `followBy` connection
    it "ends with the robot's connection, and so does that of one that is not there" $ do
      port' <- freePort
      showing [("Bob", at port')] $ \_ port -> do
        saying port' (\c -> beating c >> Websockets.sendClose c ("" :: Text)) $ \_ ->
          readingAt "/robots/Bob/live" port plainly untilClosed
        forM_ ["Bob", "Cid"] $ \name -> readingAt ("/robots/" ++ name ++ "/live") port plainly untilClosed
    it "is cut if it does not read, and the robot is live" $ robotWith Nothing $ \shown address ->
      showing [("Ann", address)] $ \_ port -> reading port plainly $ \connection -> do
        _ <- comes connection [("Ann", "live")]
        let flood = [Began (Span n Top Named (replicate 900 'x') 0 Nothing) | n <- [1 .. 1000]]
        readingAt "/robots/Ann/live" port plainly $ \silent -> do
          _ <- next silent
          atomically (readTVar (readers shown) >>= check . (== 2))
          replicateM_ 10 (tell shown flood)
          atomically (readTVar (readers shown) >>= check . (== 1))
        void (comes connection [("Ann", "live")])

  describe "Access:" $ do
    it "a web page of another origin reads nothing" $ robotWith Nothing $ \_ address ->
      showing [("Ann", address)] $ \_ port -> forM_ ["/live", "/robots/Ann/live"] $ \path ->
        forM_ ["http://evil.example", "null"] $ \origin ->
          statusOf port path [("Host", here port), ("Origin", origin)] `shouldReturn` "403"
    it "under another name it is refused" $ showing [] $ \_ port ->
      forM_ ["/", "/robots/Ann/", "/live"] $ \path ->
        statusOf port path [("Host", "evil.example"), ("Origin", "http://evil.example")] `shouldReturn` "403"
    it "there is nothing else" $ showing [] $ \_ port ->
      forM_ ["/robots", "/robots/Ann", "/robots/Ann/live.js", "/hub", "/../live"] $ \path ->
        statusOf port path [("Host", here port), ("Origin", "http://" <> here port)] `shouldReturn` "404"
    it "with a token it is for readers that show it" $ robotWith Nothing $ \_ address ->
      withHub loopback {pageToken = Just "a secret"} [("Ann", address)] $ \_ port ->
        forM_ ["/live", "/robots/Ann/live"] $ \path -> do
          readingAt path port plainly (["refused"] `followBy`)
          readingAt path port (object ["version" .= one, "token" .= ("a secret" :: Text)]) $
            next >=> (`shouldSatisfy` (`elem` ["robots", "hello"]) . message)
    it "there are at most 32 readers" $ showing [] $ \_ port -> do
      full <- newTVarIO (0 :: Int)
      let stays = reading port plainly $ \connection -> do
            ["robots"] `followBy` connection
            atomically (modifyTVar' full (+ 1))
            atomically (readTVar full >>= check . (> 32))
      withAsync (mapConcurrently_ (const stays) [1 .. 32 :: Int]) $ \_ -> do
        atomically (readTVar full >>= check . (== 32))
        reading port plainly (["refused"] `followBy`) `finally` atomically (writeTVar full 33)

  it "Its connections end with the hub: those of readers, and those to robots" $ robotWith Nothing $ \shown address ->
    forM_ ["/live", "/robots/Ann/live"] $ \path -> do
      port <- freePort
      isRead <- newTVarIO False
      let read' = reachable port . readingAt path port plainly $ \connection -> do
            _ <- next connection
            atomically (writeTVar isRead True)
            untilClosed connection
      concurrently_ read' . race_ (hub loopback {pagePort = port} (pure [("Ann", address)])) . atomically $ do
        n <- readTVar (readers shown)
        readTVar isRead >>= check . (&& n > 0)
      atomically (readTVar (readers shown) >>= check . (== 0))

  describe "What is known of a robot" $ do
    it "has at most 2,000 spans, and 200 characters of a text" $ do
      let many = [begins n (Text.replicate 5000 "x") (String "top") | n <- [1 .. 3000]]
          heard = either error doing (learn (eventsOf many) nothingKnown)
      length heard `shouldBe` 2000
      maximum [Text.length name | Doing path _ <- heard, name <- path] `shouldBe` 201
    it "has no span for running whose end was lost, once one around it has ended" $ do
      let lost = object ["event" .= ("lost" :: Text), "count" .= one]
          nested = begins 1 "a" (String "top") : [begins n "a" (toJSON (n - 1)) | n <- [2 .. 9]]
          heard = learn (eventsOf (nested ++ [lost, ends 2 "a" (toJSON one)])) nothingKnown
      fmap doing heard `shouldBe` Right [Doing ["a"] 1]
 where
  one = 1 :: Int
  only m = case rows m of
    [r] -> r
    others -> error ("one robot, not " ++ show others)
  here port = Char8.pack ("127.0.0.1:" ++ show port)
  eventsOf these = encode (object ["message" .= ("events" :: Text), "events" .= these])
  begins = aSpan "began"
  ends = aSpan "ended"
  aSpan event n name parent = object
    [ "event" .= (event :: Text), "number" .= (n :: Int), "parent" .= (parent :: Value), "kind" .= ("named" :: Text)
    , "name" .= (name :: Text), "began" .= one, "end" .= object []
    ]
  hostile =
    [ ("what is no JSON", noJson, (`say` "["))
    , ("what nests too deep", tooMuch, (`say` Bytes.replicate 100 91))
    , ("a number that is too long", tooMuch, (`say` Bytes.replicate 1000 49))
    , ("no object", "Error in $: parsing a message failed, expected Object, but encountered Array", (`say` "[]"))
    , ("events that are none", "Error in $: key \"events\" not found", (`say` "{\"message\":\"events\"}"))
    , ("a message of 17 MiB", tooLong, (`say` Bytes.replicate 17825792 32))
    ]
  long = "HTTP/1.1 101 Yes\r\nA: " <> Char8.replicate 70000 'x'
  -- (Aeson's own text, which other versions of it have in other words.)
  noJson = either Text.pack (const "") (eitherDecode "[" :: Either String Value)
  tooMuch = "it nests too deep, or has a number that is too long"
  tooLong = "what it says is no websocket's: Frame of size 17825792 exceeded limit"

-- | A hub of these robots. The action is given the variable that has them, and the port.
showing :: [(String, String)] -> (TVar [(String, String)] -> Int -> IO a) -> IO a
showing = withHub loopback {pageRobot = "fleet"}

withHub :: LivePage -> [(String, String)] -> (TVar [(String, String)] -> Int -> IO a) -> IO a
withHub page these use = do
  robots <- newTVarIO these
  port <- freePort
  withAsync (hub page {pagePort = port} (readTVar robots)) $ \itself ->
    link itself >> reachable port (use robots port)

-- | A robot's own server, with this token, and its address.
robotWith :: Maybe Text -> (Shown -> String -> IO a) -> IO a
robotWith secret use = do
  shown <- newShown defaultLimits (Run "Ann" "run" (posixSecondsToUTCTime 0)) (const (pure 0)) secret True
  withAsync (publishing shown) $ \_ -> testWithApplication (pure (application shown)) (use shown . at)

at :: Int -> String
at port = "http://127.0.0.1:" ++ show port ++ "/"

-- Returns when they are in chunks.
tell :: Shown -> [Event] -> IO ()
tell shown new = do
  before <- nextNumber <$> readTVarIO (history shown)
  receive shown new
  atomically (readTVar (history shown) >>= check . (>= before + length new) . nextNumber)

-- | While the action runs, there is a server at the port that says this on each connection, one after the other, after
-- what it does. When the action ends, it is as if it were killed. (The variable has how many connections have ended.)
saying :: Int -> (Websockets.Connection -> IO ()) -> (TVar Int -> IO a) -> IO a
saying port said use = do
  ended <- newTVarIO 0
  let serving s = do
        waiting <- Websockets.makePendingConnection s Websockets.defaultConnectionOptions
        connection <- Websockets.acceptRequest waiting
        _ <- Websockets.receiveData connection :: IO Text
        say connection (hello (Run "Bob" "run" (posixSecondsToUTCTime 0)))
        say connection . encode $ object
          [ "message" .= ("snapshot" :: Text), "now" .= (7 :: Int), "next" .= (0 :: Int), "lost" .= (0 :: Int)
          , "ended" .= ([] :: [Value]), "reacted" .= ([] :: [Value]), "running" .= map encodedSpan [1, 2]
          ]
        said connection
        void (forever (Websockets.receiveDataMessage connection))
  listeningAt port serving ended (use ended)
 where
  encodedSpan :: Int -> Value
  encodedSpan n = object
    [ "event" .= ("began" :: Text), "number" .= n, "kind" .= ("named" :: Text), "began" .= n
    , "parent" .= (if n == 1 then String "top" else toJSON (n - 1))
    , "name" .= (if n == 1 then "wait" else "for the door" :: Text)
    ]

-- | The same, of sockets.
listeningAt :: Int -> (Socket -> IO ()) -> TVar Int -> IO a -> IO a
listeningAt port serving ended act = bracket open close $ \listener -> withAsync (accepting listener) (const act)
 where
  accepting listener = forever . bracket (fst <$> accept listener) closed $ \s ->
    serving s `catches`
      [Handler (\e -> ignored (e :: IOException)), Handler (\e -> ignored (e :: Websockets.ConnectionException))]
  ignored _ = pure ()
  closed s = close s >> atomically (modifyTVar' ended (+ 1))
  open = do
    s <- socket AF_INET Stream defaultProtocol
    setSocketOption s ReuseAddr 1
    bind s (SockAddrInet (fromIntegral port) (tupleToHostAddress (127, 0, 0, 1)))
    s <$ listen s 5

say :: Websockets.Connection -> Bytes.ByteString -> IO ()
say = Websockets.sendTextData

-- | A beat, and then nothing for 0.3 s.
beating :: Websockets.Connection -> IO ()
beating connection = do
  say connection "{\"message\":\"beat\",\"now\":8,\"next\":0,\"lost\":0}"
  void (timeout 300000 (forever (Websockets.receiveDataMessage connection)))

-- | The next message of the hub of which this is true.
meets :: Websockets.Connection -> (Value -> Bool) -> IO Value
meets connection wanted = next connection >>= \m -> if wanted m then pure m else meets connection wanted

-- | The next one in which the robots, and no others, have these states.
comes :: Websockets.Connection -> [(Text, Text)] -> IO Value
comes connection wanted = meets connection ((== wanted) . standings)

rows :: Value -> [Value]
rows = field "robots"

row :: Text -> Value -> Value
row name = head . filter ((== name) . field "name") . rows

standings :: Value -> [(Text, Text)]
standings m = [(field "name" r, field "state" r) | r <- rows m]

paths :: Value -> [[Text]]
paths = map (field "path") . (field "running" :: Value -> [Value])

fieldMaybe :: FromJSON a => Text -> Value -> Maybe a
fieldMaybe name = parseMaybe (withObject "message" (.: Key.fromText name))

untilClosed :: Websockets.Connection -> IO ()
untilClosed connection = void (unlessClosed (forever (nextOfAny connection)))

-- | The status of the answer to a request for a websocket, with these headers, too; without them for the file.
statusOf :: Int -> Char8.ByteString -> [(Char8.ByteString, Char8.ByteString)] -> IO Char8.ByteString
statusOf port path headers = withConnection port $ \s -> do
  sendAll s . mconcat $
    ["GET ", path, " HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"]
      ++ ["Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"]
      ++ concat [[name, ": ", value, "\r\n"] | (name, value) <- headers] ++ ["\r\n"]
  Char8.take 3 . Char8.drop 9 <$> recv s 4096
