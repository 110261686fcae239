{-# LANGUAGE OverloadedStrings #-}

-- |
-- Topics of a robot as signals.
module Ros.TopicSpec (spec) where

import Control.Exception (try)
import Control.Monad (forM_, replicateM_, void)
import Data.Aeson (Value (..), object, (.=))
import Data.IORef
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Fake
import Behavior.Ros.Internal.Frame (Answer (..))
import Behavior.Ros.Internal.Link (keptOf, newRos)
import qualified Behavior.Ros.Internal.Receive as Receive
import Behavior.Ros.Internal.UpDown (comeUp)
import Behavior.Ros.Messages
import Behavior.STM
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Time
import Memory (inConstantMemory)
import Ros.Stage
import Support (guarded)

spec :: Spec
spec = guarded $ do
  describe "A topic" $ do
    it "has its latest message" . underSchedules 80 . withRobot $ \robot ros -> do
      seenValues <- newIORef []
      let watches = Signal.switch (latest ros level) (\l -> modifyIORef seenValues (l :) >> sleepForever)
      sequence_ [charge robot (Just l) >> sleep 1 | l <- [0.5, 0.4, 0.3]] ||| watches
      readIORef seenValues >>= (`shouldBe` map (Std . Just) [0.3, 0.4, 0.5])
    it "that never publishes chooses no branch, and is a fault after the expected silence" . underSchedules 150 $
      withRobot $ \robot ros -> do
        awaitUp ros
        inSeconds 2 (tried (deciding ros)) >>= (`shouldBe` Left silent)
        -- (It has asked again after half of that.)
        subscriptions robot >>= (`shouldBe` [0, 1])
    it "that falls silent is a fault after the expected silence" . underSchedules 150 . withRobot $ \robot ros -> do
      awaitUp ros
      let charges = sequence_ [charge robot (Just 0.5) >> sleep 1 | _ <- [1 .. 4 :: Int]] >> sleepForever
      firstOf [charges, inSeconds 5 (tried (deciding ros))] >>= (`shouldBe` Left silent)
    it "is no fault as long as a message comes within the expected silence" . underSchedules 40 . withRobot $
      \robot ros ->
        sequence_ [charge robot (Just 0.5) >> sleep 1.9 | _ <- [1 .. 10 :: Int]] ||| deciding ros
    it "has no value from before the expected silence" . underSchedules 80 . withRobot $ \robot ros -> do
      awaitUp ros
      charge robot (Just 0.05)
      _ <- Signal.read (latest ros level)
      sleep 10
      inSeconds 2 (tried (deciding ros)) >>= (`shouldBe` Left silent)
      -- (It has not subscribed again: it would have received the last message again.)
      subscriptions robot >>= (`shouldBe` [0])
    it "needs no more memory for many messages that no one reads" $ do
      ros <- newRos "nowhere" "" defaultRosOptions
      _ <- atomically (comeUp ros 0 >> keptOf ros "/level" "" 0)
      inConstantMemory 100000 $ \step ->
        replicateM_ 100000 (atomically (Receive.take ros 0 100 (Message "/level" Null)) >> step)
    it "that is latched has its value for a second reader, later" . underSchedules 80 . withRobot $ \robot ros -> do
      charge robot (Just 0.5)
      let still = topic "/level" latched :: Topic (Std (Maybe Double))
      forM_ [0, 0, 30] $ \pause -> do
        sleep pause
        inSeconds 0 (awaitUp ros >> Signal.read (latest ros still)) >>= (`shouldBe` Std (Just 0.5))
      -- One subscription for all.
      subscriptions robot >>= (`shouldBe` [0])
    it "is a fault while its last message is not what is expected" . underSchedules 80 . withRobot $ \robot ros -> do
      awaitUp ros
      let bad = publish robot "/level" (object ["data" .= String "full"])
          bads = sleep 1 >> bad >> sleepForever
          wrong = Left (Undecodable "/level" "Error in $.data: this is no number")
      firstOf [bads, inSeconds 1 (tried (Signal.read (latest ros level)))] >>= (`shouldBe` wrong)
      tried (Signal.read (latest ros level)) >>= (`shouldBe` wrong)
      charge robot (Just 0.3)
      -- (Its last message may not have come yet.)
      sleep 0.1
      Signal.read (latest ros level) >>= (`shouldBe` Std (Just 0.3))

  describe "A number that is null" $ do
    it "is neither low nor not low" . underSchedules 80 . withRobot $ \robot ros -> do
      charge robot Nothing
      tried (deciding ros) >>= (`shouldBe` Left NotMeasured)
    it "is refused where a number is expected" . underSchedules 40 . withRobot $ \robot ros -> do
      charge robot Nothing
      let strict = topic "/level" (atLeastEvery 2) :: Topic Strict
      let low = (\(Strict l) -> l < 0.1) <$> latest ros strict
      tried (sensing low) >>= \end -> case end of
        Left (Undecodable _ _) -> pure ()
        _ -> expectationFailure (show end)
  describe "NaN" $
    it "is neither low nor not low" . underSchedules 40 $ do
      let low = (< 0.1) <$> measured Just (pure (0 / 0))
      tried (sensing low) >>= (`shouldBe` Left NotMeasured)

  describe "When the link is lost" $ do
    it "a signal faults at once" . underSchedules 150 . withRobot $ \robot ros -> do
      awaitUp ros
      charge robot (Just 0.5)
      firstOf [sleep 1 >> loseLink robot >> sleepForever, inSeconds 1 (tried (deciding ros))] >>= (`shouldBe` Left lost)
    it "and is back, topics are subscribed to again" . underSchedules 80 . withRobot $ \robot ros -> do
      awaitUp ros
      charge robot (Just 0.5)
      _ <- Signal.read (latest ros level)
      loseLink robot >> sleep 5 >> restoreLink robot
      Signal.waitUntil (linkUp ros)
      sleep 0.1
      subscriptions robot >>= (`shouldSatisfy` ((== 2) . length))
      charge robot (Just 0.2)
      void (Signal.read (latest ros level))
    it "a value from before is none afterwards, also of a topic that is latched" . underSchedules 80 . withRobot $
      \robot ros -> do
        let still = topic "/door" latched :: Topic (Std Bool)
        awaitUp ros
        publish robot "/door" (object ["data" .= True])
        _ <- Signal.read (latest ros still)
        loseLink robot
        Signal.waitUntil (not <$> linkUp ros)
        -- (It connects, and then receives nothing.)
        restoreLink robot >> freezeLink robot
        Signal.waitUntil (linkUp ros)
        stopAfter 1 (Signal.read (latest ros still)) >>= (`shouldBe` Nothing)
    it "and does not come back, a signal fails" . underSchedules 40 . withRobot $ \robot ros -> do
      awaitUp ros
      loseLink robot
      Signal.waitUntil (not <$> linkUp ros)
      inSeconds 5 (try (deciding ros)) >>= (`shouldBe` Left noLink)
  describe "An expected silence" $
    it "is at least a microsecond" $
      withRobot (\_ ros -> void (Signal.read (latest ros (topic "/level" (atLeastEvery 0) :: Topic Value))))
        `shouldThrow` errorCall "latest /level: a period is at least 0.000001 seconds, not 0.0"

withRobot :: (FakeRobot -> Ros -> Behavior a) -> Behavior a
withRobot = mission (const succeeding)

level :: Topic (Std (Maybe Double))
level = topic "/level" (atLeastEvery 2)

-- | A number that is not expected to be null.
newtype Strict = Strict Double

instance RosMessage Strict where
  fromRos value = fromRos value >>= \(Std x) -> maybe (Strict <$> fromRos Null) (pure . Strict) x
  toRos (Strict x) = toRos (Std (Just x))

charge :: FakeRobot -> Maybe Double -> Behavior ()
charge robot = publish robot "/level" . toRos . Std

-- | Reacts to whether the battery is low, and never ends by itself.
deciding :: Ros -> Behavior String
deciding ros = Signal.rSelect ((< 0.1) <$> measured unStd (latest ros level)) sleepForever sleepForever

-- | Runs one branch if the battery is low, and another if it is not.
sensing :: Signal Bool -> Behavior String
sensing low = Signal.rSelect low (pure "low") (pure "not low")

tried :: Behavior a -> Behavior (Either RosFault a)
tried = try

silent, lost :: RosFault
silent = Silent "/level" 2
lost = LinkLost "the fake robot" "user error (connection lost)"

awaitUp :: Ros -> Behavior ()
awaitUp = Signal.waitUntil . linkUp

-- | When the robot was asked for the topic.
subscriptions :: FakeRobot -> Behavior [Seconds]
subscriptions robot = (\came -> [time | (time, Subscribed "/level") <- came]) <$> atomically (seen robot)
