{-# LANGUAGE OverloadedStrings #-}

-- |
-- The link to a robot: what comes over it that is no frame, and how it is kept.
module Ros.LinkSpec (spec) where

import Control.Concurrent (rtsSupportsBoundThreads)
import Control.Exception (ErrorCall (..), finally, throwIO, try)
import Control.Monad (forM_, replicateM_, void)
import qualified Data.ByteString.Lazy as Bytes
import qualified Data.ByteString.Lazy.Char8 as Chars
import Data.Foldable (traverse_)
import Data.IORef
import Data.List (isInfixOf)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Fake
import Behavior.Ros.Internal.Frame
import Behavior.Ros.Internal.Transport
import Behavior.Ros.Messages (Std (..))
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Sim (events, simulate)
import Behavior.Time
import Behavior.Trace (Change (..), End (..), Event (..), Reaction (..), Span (..))
import Ros.Stage
import Support (ending, guarded)
import qualified Support

spec :: Spec
spec = guarded $ do
  describe "What is no frame" $ do
    it "is refused, counted and reported, and the goal goes on" . underSchedules 10 $ do
      reported <- newIORef []
      let options = defaultRosOptions {onReport = \line -> modifyIORef reported (line :)}
      missionWith options (const slowly) $ \robot ros -> do
        Signal.waitUntil (linkUp ros)
        let sending = sleep 1 >> forM_ hostile (sendBytes robot . fst) >> sleepForever
        _ <- firstOf [sending, inSeconds 60 (carrying ros "cup")]
        Signal.read (refusedFrames ros) >>= (`shouldBe` length hostile)
        said <- reverse <$> readIORef reported
        forM_ (zip said (map snd hostile)) $ \(line, why) -> line `shouldSatisfy` (why `isInfixOf`)
        length said `shouldBe` length hostile
    it "is counted also when there are too many lines, each of which is a short one" . underSchedules 10 $ do
      reported <- newIORef []
      let options = defaultRosOptions {onReport = \line -> sleep 1 >> modifyIORef' reported (line :)}
          complaint = Bytes.concat ["{\"op\":\"status\",\"msg\":\"no\\nsuch ", Chars.replicate 5000 'x', "\"}"]
      missionWith options (const slowly) $ \robot ros -> do
        Signal.waitUntil (linkUp ros)
        replicateM_ 200 (sendBytes robot complaint)
        sleep 100
        sendBytes robot "?"
        sleep 1.5
        said <- reverse <$> readIORef reported
        head said `shouldBe` "the bridge complains: no such " ++ replicate 170 'x' ++ "..."
        let leftOut = [read n | line <- said, "(and" : n : _ <- [dropWhile (/= "(and") (words line)]]
        length said + sum leftOut `shouldBe` 201
        filter ((> 260) . length) said `shouldBe` []
    it "is refused where it is an answer that nothing awaits" . underSchedules 10 $
      missionWith defaultRosOptions (const slowly) $ \robot ros -> do
        Signal.waitUntil (linkUp ros)
        traverse_ (sendBytes robot) unawaited
        sleep 1
        Signal.read (refusedFrames ros) >>= (`shouldBe` length unawaited)
    it "is refused by its depth before it is parsed" $ do
      let deep n = Bytes.concat ["{\"op\":\"x\",\"a\":", Chars.replicate (n - 1) '[', Chars.replicate (n - 1) ']', "}"]
      decodeAnswer limits (deep 64) `shouldBe` Right (Other "x")
      decodeAnswer limits (deep 65) `shouldBe` Left "a frame that nests deeper than 64"
    it "is refused by the digits of a number, but not by those of a text" $ do
      let digits n = Bytes.concat ["{\"op\":\"x\",\"a\":0.", Chars.replicate n '1', "}"]
          text n = Bytes.concat ["{\"op\":\"x\",\"a\":\"\\\"", Chars.replicate n '1', "\"}"]
      decodeAnswer limits {mostBytes = 10000} (digits 1100) `shouldBe` Right (Other "x")
      decodeAnswer limits {mostBytes = 10000} (digits 1101) `shouldBe` Left "a number of more than 1100 digits"
      decodeAnswer limits {mostBytes = 10000} (text 5000) `shouldBe` Right (Other "x")
    it "is refused by its size" $ do
      let large n = Bytes.concat ["{\"op\":\"x\"}", Chars.replicate (n - 10) ' ']
      decodeAnswer limits (large 1000) `shouldBe` Right (Other "x")
      decodeAnswer limits (large 1001) `shouldBe` Left "a frame of 1001 bytes; allowed: 1000"
  describe "A report" $
    it "that faults stops the behaviour, and is thrown" . underSchedules 40 $ do
      let options = defaultRosOptions {onReport = const throwFault}
      end <- ending . missionWith options (const slowly) $ \robot ros -> do
        Signal.waitUntil (linkUp ros)
        sendBytes robot "?"
        void (carrying ros "cup")
      end `shouldBe` Support.FaultedWith "user error (full disk)"

  describe "A link" $ do
    it "that is half open is lost after a ping" . underSchedules 80 . missionWith defaultRosOptions (const slowly) $
      \robot ros -> do
        Signal.waitUntil (linkUp ros)
        let freezing = sleep 10.5 >> freezeLink robot >> sleepForever
        end <- firstOf [freezing, inSeconds 12 (try (carrying ros "cup"))]
        either (`shouldSatisfy` isLost) (const (expectationFailure "it returned")) end
    it "that is quiet is not lost" . underSchedules 10 . missionWith defaultRosOptions (const slowly) $
      \robot ros -> do
        sleep 60
        Signal.read (linkUp ros) >>= (`shouldBe` True)
        atomically (seen robot) >>= (`shouldBe` [(0, Connected)])
    it "is there again soon after the bridge" . underSchedules 80 . mission (const slowly) $ \robot ros -> do
      Signal.waitUntil (linkUp ros)
      loseLink robot >> sleep 10 >> restoreLink robot
      began <- now
      Signal.waitUntil (linkUp ros)
      took <- subtract began <$> now
      took `shouldSatisfy` (<= 1)
    it "does not outlive its behaviour, and is of no use then" . underSchedules 40 . withFakeRobot [] $ \robot -> do
      ros <- withRos (fakeRos robot) pure
      end <- try (carrying ros "cup")
      either (\e -> e `shouldBe` LinkLost "the fake robot" "its withRos has ended") (const (expectationFailure "!")) end
    it "that faults while it is closed says so to no one" . underSchedules 40 $ do
      let asking = abandoning 1 (sleepForever `finally` throwFault)
          throws = Transport "a name that no server knows" Nothing (pure "") (\_ _ _ -> asking)
      inSeconds 0 (withRos throws (\_ -> sleep 0))
      stopAfter 20 (withRos throws (const sleepForever)) >>= (`shouldBe` (Nothing :: Maybe ()))
    it "is a span in a trace, which says why it was lost" $ do
      run <- simulate . mission (const slowly) $ \robot ros -> do
        Signal.waitUntil (linkUp ros)
        sleep 1 >> loseLink robot >> sleep 1 >> restoreLink robot
        Signal.waitUntil (linkUp ros)
        sleep 1
      [(spanBegan s, time, how) | Ended s time how <- events run, spanName s == "link: the fake robot"]
        `shouldBe` [(0, 1, FaultedWith "user error (connection lost)"), (2.5, 3.5, Succeeded)]
    it "is noticed in a trace when it comes up and when it is lost, and why" $ do
      run <- simulate . mission (const slowly) $ \robot ros -> do
        Signal.waitUntil (linkUp ros)
        sleep 1 >> loseLink robot >> sleep 1 >> restoreLink robot
        Signal.waitUntil (linkUp ros)
      let up = Change "link up" (Just "False") "True"
          down = Change "link up" (Just "True") "False"
      [(reactionTime r, reactionChanges r) | Reacted r <- events run, reactionOperator r == "link"]
        `shouldBe` [(0, [up]), (1, [Change "cause" Nothing "user error (connection lost)", down]), (2.5, [up])]
    it "of another robot is not concerned" . underSchedules 40 . withFakeRobot [] $ \one ->
      mission (const slowly) $ \_ ros ->
        (sleep 5 >> loseLink one) `both` withRos (fakeRos one) (\_ -> inSeconds 60 (void (carrying ros "cup")))

  describe "A bridge that is slow to take what is sent" $ do
    it "is given a cancel before what is published" . underSchedules 40 $ do
      frames <- onSlowBridge 1 $ \ros count -> do
        let floods = sleep 2 >> count
        void (stopAfter 4 (carrying ros "cup")) `both` floods
      takeWhile (not . has "cancel") frames `shouldSatisfy` ((< 6) . length)
      filter (has "cancel") frames `shouldSatisfy` not . null
    it "is not given a goal that is stopped while it waits to be sent" . underSchedules 40 $ do
      frames <- onSlowBridge 1 $ \ros count -> do
        count
        inSeconds 3 (void (stopAfter 3 (carrying ros "cup")))
        Signal.read (movingGoals ros) >>= (`shouldBe` 0)
      filter (has "goal") frames `shouldBe` []
    it "is given what waits before the link ends, however the mission ends" $
      forM_ [pure (), void failed, sleepForever] $ \ends -> underSchedules 40 $ do
        frames <- onSlowBridge 0.01 $ \_ count -> void (stopAfter 0.1 ends) `finally` count
        length (filter (has "publish") frames) `shouldBe` 50
    it "is not waited for longer than a second" . underSchedules 40 $ do
      frames <- inSeconds 1 (onSlowBridge 0.1 (const id))
      length (filter (has "publish") frames) `shouldSatisfy` (< 12)

  describe "An address" $ do
    forM_ [("ws://127.0.0.1:9090", True), ("ws://localhost:1/x", True), ("ws://[::1]:9090", True)] allowed
    forM_ [("ws://10.0.0.1:9", False), ("wss://10.0.0.1:9", rtsSupportsBoundThreads), ("ws://127.0.0.1", False)] allowed
    forM_ [("ws://127.evil.org:1", False), ("ws://127.0.0.1:70000", False), ("", False)] allowed
    forM_ [("ws://127.0.0.1:18446744073709560706", False)] allowed
  describe "A duration" $
    it "is not negative" $
      withFakeRobot [] (\robot -> withRosOptions defaultRosOptions {patience = -1} (fakeRos robot) (\_ -> pure ()))
        `shouldThrow` errorCall "withRosOptions: a duration is zero or more seconds, not -1.0"
 where
  has text frame = text `isInfixOf` Chars.unpack frame
  limits = Limits 1000 64
  throwFault = ioError (userError "full disk")
  isLost e = case e of
    LinkLost _ why -> "nothing was received" `isInfixOf` why
    _ -> False
  allowed (bridgeAddress, is) = it (show bridgeAddress ++ " is " ++ (if is then "allowed" else "refused")) $ do
    end <- try (withRos (rosbridge bridgeAddress) (\_ -> pure ()))
    either (\(ErrorCall _) -> False) (const True) end `shouldBe` is

-- | The frames that are sent to a bridge which takes so long for each, and answers nothing; by a mission that is given
-- what publishes fifty messages, and has a minute.
onSlowBridge :: Seconds -> (Ros -> Behavior () -> Behavior ()) -> Behavior [Bytes.ByteString]
onSlowBridge pause act = do
  taken <- newIORef []
  over <- newTVarIO False
  let takes frame = modifyIORef' taken (frame :) >> sleep pause
      closes = atomically (writeTVar over True)
      way = Transport "slow" Nothing (pure "") $ \_ received use ->
        use (Connection ended (pure 0) takes received closes)
      ended = atomically (readTVar over >>= check) >> throwIO (userError "it was closed")
      counts = publication "/count" :: Publication (Std (Maybe Double))
  end <- try . timeout 60 . withRosOptions defaultRosOptions {patience = 10, pingEvery = 1000} way $ \ros ->
    publishing ros counts $ \say -> act ros (forM_ [1 .. 50] (say . Std . Just))
  case end of
    Left (NotConfirmed "/carry" _) -> pure ()
    Left other -> throwIO other
    Right () -> pure ()
  reverse <$> readIORef taken

-- | Frames that are none, and what is said about them.
hostile :: [(Bytes.ByteString, String)]
hostile =
  [ ("", "is no JSON")
  , ("{\"op\":\"publish\",\"topic\":\"/level\",\"msg\":{\"data\":0.", "is no JSON")
  , ("[]", "rosbridge does not have")
  , ("{\"id\":\"goal 1\",\"status\":4}", "rosbridge does not have")
  , ("{\"op\":4}", "rosbridge does not have")
  , ("{\"op\":\"action_result\",\"id\":\"goal 1\",\"status\":\"4\"}", "rosbridge does not have")
  , ("{\"op\":\"action_result\",\"id\":\"goal 1\",\"status\":2}", "a result with the status 2")
  , ("{\"op\":\"action_result\",\"id\":1,\"status\":4}", "rosbridge does not have")
  , ("{\"op\":\"action_result\",\"id\":\"goal 1\",\"status\":1e1000000000}", "rosbridge does not have")
  , ("{\"op\":\"publish\",\"topic\":\"/level\",\"msg\":NaN}", "is no JSON")
  , (Chars.replicate 1000000 '[', "nests deeper than 64")
  , (Chars.replicate 1048577 ' ', "a frame of 1048577 bytes")
  , ("\255\254", "is no JSON")
  ]

-- | Frames about what was never asked.
unawaited :: [Bytes.ByteString]
unawaited =
  [ "{\"op\":\"action_result\",\"id\":\"goal 1000\",\"status\":4,\"values\":{}}"
  , "{\"op\":\"action_feedback\",\"id\":\"goal 1000\",\"values\":{}}"
  , "{\"op\":\"service_response\",\"id\":\"call 1000\",\"result\":true,\"values\":{}}"
  , "{\"op\":\"publish\",\"topic\":\"/nowhere\",\"msg\":{}}"
  , "{\"op\":\"surprise\"}"
  ]
