{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Messages: each of a topic once, and how they are read and written.
module Ros.MessagesSpec (spec) where

import Control.Exception (SomeException, try)
import Control.Monad (forM_, replicateM, replicateM_)
import Data.Aeson (Value (..), decode, object, (.=))
import qualified Data.Aeson.Key as Key
import qualified Data.Aeson.KeyMap as KeyMap
import qualified Data.ByteString as ByteString
import qualified Data.ByteString.Lazy as Lazy
import Data.IORef
import Data.Int (Int32)
import Data.List (sort)
import Data.Maybe (isJust)
import Data.Proxy (Proxy (..))
import Data.Text (Text)
import qualified Data.Text as Text
import Test.Hspec hiding (parallel)
import Test.QuickCheck (property, (===))

import Behavior
import Behavior.Message
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Fake
import Behavior.Ros.Internal.Message (decoded)
import Behavior.Ros.Messages
import Behavior.Ros.Messages.Geometry
import Behavior.Ros.Messages.Navigation
import Behavior.Ros.Messages.Sensor
import Behavior.Ros.Messages.Test
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Time
import Ros.Stage hiding (named)
import Support (guarded)

spec :: Spec
spec = guarded $ do
  describe "Messages" $ do
    it "are handled once each, also beside a signal of the topic and a second inbox" . withRobot $ \robot ros ->
      withMessages ros numbers 10 $ \one -> withMessages ros numbers 10 $ \other -> do
        said <- newIORef []
        let handles inbox = replicateM_ 3 (handleNext inbox (\(Std n) -> pure () <$ modifyIORef said (n :)))
            latestIs n = Signal.waitUntil ((== Std n) <$> latest ros numbers)
        handles one `both` handles other `both` latestIs 3 `both` forM_ [1 .. 3] (\n -> sleep 1 >> say robot n)
        readIORef said >>= (`shouldMatchList` [1, 1, 2, 2, 3, 3])
    it "that wait are bounded: the oldest is dropped, and counted" . withRobot $ \robot ros ->
      withMessages ros numbers 3 $ \inbox -> do
        sleep 1
        forM_ [1 .. 10] (say robot)
        sleep 1
        kept <- atomically ((,) <$> replicateM 3 (receive inbox) <*> dropped inbox)
        kept `shouldBe` (map Std [8, 9, 10], 7)
    it "that are not what is expected fault where they are used" . withRobot $ \robot ros -> do
      end <- try . withMessages ros numbers 3 $ \inbox -> do
        sleep 1
        publish robot "/numbers" (object ["data" .= ("many" :: Text)])
        handleNext inbox (\(Std n) -> pure () <$ (n `shouldBe` 1))
      either (\(e :: SomeException) -> show e `shouldContain` "Undecodable \"/numbers\"") pure end
    it "fault at once when the link is lost, and after the expected silence" . withRobot $ \robot ros -> do
      Signal.waitUntil (linkUp ros)
      let waits t = tried (withMessages ros t 3 (const sleepForever)) :: Behavior (Either RosFault ())
          often = topic "/numbers" (atLeastEvery 4) :: Topic (Std Int32)
      inSeconds 4 (waits often) >>= (`shouldBe` Left (Silent "/numbers" 4))
      end <- firstOf [sleep 1 >> loseLink robot >> sleepForever, inSeconds 1 (waits numbers)]
      end `shouldBe` Left (LinkLost "the fake robot" "user error (connection lost)")
    it "do not come any more when the behaviour has ended" . withRobot $ \robot ros -> do
      inbox <- withMessages ros numbers 3 $ \inbox -> inbox <$ Signal.waitUntil (linkUp ros)
      say robot 1
      sleep 1
      atomically (unhandled inbox) >>= (`shouldBe` 0)
    it "may be larger where the topic allows it" . withRobotUnder 4 $ \robot ros -> do
      let texts = topic "/texts" latched :: Topic (Std Text)
          large name = publish robot name (object ["data" .= Text.replicate 1200000 "x"]) >> sleep 1
          comes t = isJust <$> stopAfter 1 (Signal.read (latest ros t))
      comes texts >>= (`shouldBe` False)
      large "/texts"
      comes texts >>= (`shouldBe` False)
      Signal.read (refusedFrames ros) >>= (`shouldBe` 1)
      comes (upToBytes 2000000 texts) >>= (`shouldBe` False)
      large "/texts"
      comes texts >>= (`shouldBe` True)
      -- Another topic is not concerned.
      let others = topic "/others" latched :: Topic (Std Text)
      comes others >>= (`shouldBe` False)
      large "/others"
      comes others >>= (`shouldBe` False)
    it "of a simulator's clock are its time" . withRobot $ \robot ros -> do
      let tick t = publish robot "/clock" (object ["clock" .= toRos (fromSeconds t)])
          ticks = forM_ [100, 110 .. 200] (\t -> tick t >> sleep 1)
      ticks ||| inSeconds 5 (Signal.waitUntil ((>= 150) <$> rosTime ros (atLeastEvery 2)))

  describe "A message is read as it was written:" $ do
    let roundTrip name a = it name (decoded (toRos a) `shouldBe` Right a)
        place = at "map" (3, 1.5) 0.5
        velocity = Twist (Vector3 1 0 0) (Vector3 0 0 0.1)
        covariances = map fromIntegral [1 .. 36 :: Int]
    roundTrip "PoseStamped" place
    roundTrip "PointStamped" (Stamped (header place) (position (content place)))
    roundTrip "Vector3Stamped" (Stamped (header place) (Vector3 1 2 3))
    roundTrip "TwistStamped" (Stamped (header place) velocity)
    roundTrip "PoseWithCovarianceStamped" (Stamped (header place) (WithCovariance (content place) covariances))
    roundTrip "TwistWithCovarianceStamped" (Stamped (header place) (WithCovariance velocity covariances))
    roundTrip "Transform" (Transform (Vector3 1 2 3) (facing 1))
    roundTrip "LaserScan" (LaserScan (header place) (-1) 1 0.5 0 0.1 0.1 (Just 10) [Just 1, Nothing] [])
    roundTrip "BatteryState" (BatteryState (Just 12) Nothing True)
    roundTrip "a goal of NavigateToPose" (to place)
    roundTrip "a result of NavigateToPose" (NavigateToPoseResult 1 "blocked")
    roundTrip "feedback of NavigateToPose" (NavigateToPoseFeedback place 1.5 2 3 (Just 4.5))
    roundTrip "a goal of Fibonacci" (Order 7)
    roundTrip "a result of Fibonacci" (Sequence [0, 1, 1, 2])
    it "bytes, in base64 or as numbers" $ do
      decoded (toRos (Bytes (ByteString.pack [0 .. 255]))) `shouldBe` Right (Bytes (ByteString.pack [0 .. 255]))
      parsed "[0,255]" `shouldBe` Right (Bytes (ByteString.pack [0, 255]))
      parsed "\"AP8=\"" `shouldBe` Right (Bytes (ByteString.pack [0, 255]))
      (parsed "\"AP8\"" :: Either String Bytes) `shouldSatisfy` either (const True) (const False)
      (parsed "[256]" :: Either String Bytes) `shouldSatisfy` either (const True) (const False)
    it "times, to the nanosecond" . property $ \(s :: Int32) ->
      let time = Time (s `div` 1000) 123456789 in fromSeconds (toSeconds time) === time
    it "with the fields that Nav2's definition of NavigateToPose has" $ do
      fieldsOf (to place) `shouldBe` ["behavior_tree", "pose"]
      fieldsOf (NavigateToPoseResult 1 "blocked") `shouldBe` ["error_code", "error_msg"]
      -- (Later distributions have two more, which are not read.)
      fieldsOf (NavigateToPoseFeedback place 1.5 2 3 (Just 4.5))
        `shouldBe` [ "current_pose"
                   , "distance_remaining"
                   , "estimated_time_remaining"
                   , "navigation_time"
                   , "number_of_recoveries"
                   ]
    it "results from distributions that have less in them" $
      parsed "{}" `shouldBe` Right (NavigateToPoseResult 0 "")
    it "null is no number" $
      (parsed "{\"x\":null,\"y\":0,\"z\":0}" :: Either String Vector3)
        `shouldBe` Left "Error in $.x: null for a number (a number that may be null is a Maybe Double)"
    it "their types have ROS's names" $ do
      messageType (Proxy :: Proxy (Stamped Pose)) `shouldBe` "geometry_msgs/msg/PoseStamped"
      messageType (Proxy :: Proxy LaserScan) `shouldBe` "sensor_msgs/msg/LaserScan"
 where
  fieldsOf message = case toRos message of
    Object fields -> sort (map Key.toText (KeyMap.keys fields))
    _ -> []
  numbers = topic "/numbers" latched :: Topic (Std Int32)
  say robot n = publish robot "/numbers" (toRos (Std (n :: Int32)))
  withRobot = withRobotUnder 40
  withRobotUnder schedules act = underSchedules schedules . withFakeRobot [] $ \robot ->
    withRosOptions defaultRosOptions {pingEvery = 10} (fakeRos robot) (act robot)
  tried :: Behavior a -> Behavior (Either RosFault a)
  tried = try

-- | What is read from this text.
parsed :: RosMessage a => Lazy.ByteString -> Either String a
parsed text = maybe (Left "no JSON") decoded (decode text :: Maybe Value)
