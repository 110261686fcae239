{-# LANGUAGE OverloadedStrings #-}

-- |
-- The same over a real websocket: a server on this machine, behind which is a fake robot.
module Ros.WebsocketSpec (spec) where

import Control.Concurrent.MVar
import Control.Exception (bracket, try)
import Control.Monad (forM_, forever, void, when)
import Data.Aeson (Value, object, (.=))
import qualified Data.ByteString.Char8 as Chars
import Data.List (nub)
import Network.Socket (accept, close, socketPort)
import Network.Socket.ByteString (sendAll)
import qualified Network.WebSockets as Websockets
import System.IO.Unsafe (unsafeInterleaveIO)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Internal.Concurrent.Service
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Fake
import Behavior.Ros.Internal.Frame (Limits (..), Request (SendGoal), decodeRequest)
import Behavior.Ros.Internal.Link (outgoing, received)
import Behavior.Ros.Internal.Transport
import Behavior.Ros.Messages
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Time
import Ros.Bridge
import Ros.Stage
import Support (guarded)

spec :: Spec
spec = guarded $ do
  it "a goal gives its result" $
    onSocket quickly $ \_ ros -> carrying ros "cup" >>= (`shouldBe` "a cup")
  it "a goal that is stopped ends when the robot has confirmed that it has stopped" $
    onSocket slow $ \robot ros -> do
      Signal.waitUntil (linkUp ros)
      started <- try (isRunning robot ||| carrying ros "cup")
      either (\e -> expectationFailure (show (e :: RosFault))) pure started
      atomically (runningGoals robot) >>= (`shouldBe` [])
      came <- map snd <$> atomically (seen robot)
      [status | GoalEnded 1 status <- came] `shouldBe` [5]
  it "a topic has its messages" $
    onSocket quickly $ \robot ros -> do
      let level = topic "/level" (atLeastEvery 10) :: Topic (Std (Maybe Double))
          charge l = publish robot "/level" (object ["data" .= (l :: Double)])
      charge 0.5
      both
        (Signal.waitUntil ((> 0.1) <$> measured unStd (latest ros level)) >> charge 0.05)
        (Signal.waitUntil ((< 0.1) <$> measured unStd (latest ros level)))
  it "a goal faults when the bridge ends" $
    onSocket slow $ \robot ros -> do
      end <- try (firstOf [isRunning robot >> loseLink robot >> sleepForever, carrying ros "cup"])
      case end of
        Left (LinkLost _ _) -> pure ()
        _ -> expectationFailure (show end)
  it "a link is there again after the bridge" $
    onSocket quickly $ \robot ros -> do
      Signal.waitUntil (linkUp ros)
      loseLink robot
      Signal.waitUntil (not <$> linkUp ros)
      restoreLink robot
      void (carrying ros "cup")
  it "what is published last comes to the robot before the link ends" $
    withFakeRobot [] $ \robot -> withBridge robot $ \bridgeAddress ->
      forM_ [1 .. 30] $ \n -> do
        let speed = publication "/speed" :: Publication (Std (Maybe Double))
        withRosOptions patient (rosbridge bridgeAddress) (\ros -> publishing ros speed ($ Std (Just n)))
        came <- map snd <$> atomically (seen robot)
        came `shouldContain` [Published "/speed" (object ["data" .= n])]
  it "goals of two links have different names" $
    withFakeRobot [("/carry", quickly)] $ \robot -> withBridge robot $ \url -> do
      frames <- newTVarIO []
      let keeping frame = atomically (modifyTVar' frames (frame :))
          observed one = one {sendFrame = \frame -> keeping frame >> sendFrame one frame}
          way = rosbridge url
          watched = way {connecting = \bytes pong use -> connecting way bytes pong (use . observed)}
      forM_ [1, 2 :: Int] $ \_ -> withRosOptions patient watched (`carrying` "cup")
      sent <- map (decodeRequest (Limits 10000 64)) <$> readTVarIO frames
      let names = [n | Right (SendGoal n _ _ _) <- sent]
      length names `shouldBe` 2
      names `shouldBe` nub names
  it "a link is not lost while a frame takes long to be read" $ do
    (pings, isSubscribed, arriving) <- (,,) <$> newTVarIO (0 :: Int) <*> newTVarIO False <*> newEmptyMVar
    frames <- newEmptyMVar
    unsafeInterleaveIO (takeMVar arriving) >>= putMVar frames
    let way = Transport "slow" Nothing (pure "") (\_ pong use -> use (connection pong))
        connection pong =
          Connection
            { receiveFrame = tryTakeMVar frames >>= maybe sleepForever pure
            , sendFrame = \_ -> atomically (writeTVar isSubscribed True)
            , -- (From the sixth on they are answered: the frame arrives after the eighth.)
              sendPing = atomically (stateTVar pings (\n -> (n + 1, n + 1))) >>= \n -> when (n > 5) pong
            , bytesCame = pure 0
            , sendClose = pure ()
            }
        arrives = do
          atomically $ (&&) <$> ((>= 8) <$> readTVar pings) <*> readTVar isSubscribed >>= check
          putMVar arriving "{\"op\":\"publish\",\"topic\":\"/level\",\"msg\":{\"data\":0.5}}"
    withRosOptions defaultRosOptions {pingEvery = 0.01, pongWithin = 0.01} way $ \ros ->
      arrives `both` do
        level <- Signal.read (latest ros (topic "/level" latched))
        level `shouldBe` Std (Just 0.5 :: Maybe Double)
  it "a link is not lost while a frame takes long to come" $ do
    (pings, isSubscribed, frames) <- (,,) <$> newTVarIO (0 :: Int) <*> newTVarIO False <*> newTVarIO (1 :: Int)
    let way = Transport "slow" Nothing (pure "") (\_ _ use -> use connection)
        connection =
          Connection
            { receiveFrame = atomically $ do
                (&&) <$> ((>= 8) <$> readTVar pings) <*> readTVar isSubscribed >>= check
                stateTVar frames (\n -> (n, n - 1)) >>= check . (> 0)
                pure "{\"op\":\"publish\",\"topic\":\"/level\",\"msg\":{\"data\":0.5}}"
            , sendFrame = \_ -> atomically (writeTVar isSubscribed True)
            , sendPing = atomically (modifyTVar' pings (+ 1))
            , -- (Of the frame a byte comes after each ping.)
              bytesCame = readTVar pings
            , sendClose = pure ()
            }
    withRosOptions defaultRosOptions {pingEvery = 0.01, pongWithin = 5} way $ \ros -> do
      level <- Signal.read (latest ros (topic "/level" latched))
      level `shouldBe` Std (Just 0.5 :: Maybe Double)
  it "a publisher ends although the bridge takes nothing" $ do
    let stuck = Connection sleepForever (pure 0) (const sleepForever) sleepForever sleepForever
        speed = publication "/speed" :: Publication (Std (Maybe Double))
        full ros = atomically (isFullTBQueue (outgoing ros) >>= check)
    withRosOptions patient {pingEvery = 1000} (Transport "stuck" Nothing (pure "") (\_ _ use -> use stuck)) $ \ros ->
      publishing ros speed (\say -> full ros ||| forever (say (Std (Just 1))))
  it "an answer to the handshake that does not end is refused" $
    bracket (Websockets.makeListenSocket "127.0.0.1" 0) close $ \listening -> do
      port <- socketPort listening
      let endless = forever $ do
            (socket, _) <- accept listening
            tryAny (sendAll socket "HTTP/1.1 101 x\r\nx: " >> forever (sendAll socket (Chars.replicate 4096 'a')))
              >> close socket
          toPort = withRosOptions defaultRosOptions {noServerAfter = 0.5} (rosbridge ("ws://127.0.0.1:" ++ show port))
      end <- servedBy endless (try (toPort (`carrying` "cup")))
      case end of
        Left (NoServer _ why) -> why `shouldContain` "64 KiB"
        other -> expectationFailure (show other)
  it "a link whose bridge answers pings stays" $
    onSocketWith patient {pingEvery = 0.01} quickly $ \robot ros -> do
      Signal.waitUntil (linkUp ros)
      -- (The server's thread that receives answers them; nothing else comes.)
      pongs <- Signal.read (Signal.watching (readTVar (received ros)))
      Signal.waitUntil ((> pongs + 3) <$> Signal.watching (readTVar (received ros)))
      atomically (map snd <$> seen robot) >>= (`shouldBe` [Connected])
 where
  quickly = const succeeding {endsAfter = 0.01, endsWith = Succeeds "a cup"}
  slow = const succeeding {endsAfter = 3600, confirmsAfter = 0.05, acceptedAfter = 0.01}
  isRunning robot = atomically (runningGoals robot >>= check . not . null)

onSocket :: (Value -> GoalScript) -> (FakeRobot -> Ros -> Behavior a) -> Behavior a
onSocket = onSocketWith patient

-- | A mission whose link is a real websocket.
onSocketWith :: RosOptions -> (Value -> GoalScript) -> (FakeRobot -> Ros -> Behavior a) -> Behavior a
onSocketWith options script act =
  withFakeRobot [("/carry", script)] $ \robot ->
    withBridge robot (\bridgeAddress -> withRosOptions options (rosbridge bridgeAddress) (act robot))
