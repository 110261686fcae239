{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE ScopedTypeVariables #-}
{-# LANGUAGE TypeFamilies #-}

-- |
-- What a program asks of a robot besides goals: services, parameters, publishing, and stopping everything.
module Ros.CallSpec (spec) where

import Control.Exception (ArithException (..), ErrorCall (..), MaskingState (Unmasked), throw, try)
import Control.Monad (void)
import Data.Aeson (Value (..), object, (.=))
import qualified Data.Map.Strict as Map
import Data.Text (Text)
import qualified Data.Text as Text
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Parallel (allOf, firstOf)
import Behavior.Ros
import Behavior.Ros.Action
import Behavior.Ros.Fake
import Behavior.Ros.Internal.Frame (Answer (..), encodeAnswer)
import Behavior.Ros.Internal.Link (Reply (..), Ros (calls), newRos)
import qualified Behavior.Ros.Internal.Receive as Receive
import Behavior.Ros.Internal.Status (Statuses (..))
import Behavior.Ros.Internal.UpDown (comeUp, goDown)
import Behavior.Ros.Messages
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Time
import Ros.Stage
import Support (guarded)

spec :: Spec
spec = guarded $ do
  describe "A call" $ do
    it "gives the answer" . withService (const (ServiceScript 0.5 (Right "on"))) $ \_ ros ->
      inSeconds 0.5 (call ros lights "now") >>= (`shouldBe` "on")
    it "gives each caller the answer to its own question" . withService later $ \_ ros -> do
      let asks n = call ros lights (Number n) >>= (`shouldBe` Number n)
      void (allOf (map asks [3, 1, 2, 1, 4]))
    it "fails with the reason of a service that could not answer" . withService (says (Left "no bulb")) $ \_ ros ->
      try (call ros lights Null) >>= (`shouldBe` Left (ServiceFailed "/lights" "no bulb"))
    it "fails if there is no such service" . withService (answering 0) $ \_ ros ->
      try (call ros (untypedService "/horn" "std_srvs/srv/Trigger") Null)
        >>= (`shouldBe` Left (ServiceFailed "/horn" "there is no such service"))
    it "fails if the answer is too slow, and a late answer is no other call's" . withService later $ \_ ros -> do
      inSeconds 5 (try (call ros lights (Number 6))) >>= (`shouldBe` Left (TooSlow "/lights" 5))
      call ros lights (Number 2) >>= (`shouldBe` Number 2)
    it "faults if the answer is not what is expected" . withService (answering 0) $ \robot ros -> do
      offerService robot "/arm/get_parameters" (says (Right (object ["values" .= False])))
      end <- try (getParameter ros "/arm" "speed")
      case end of
        Left (Undecodable "/arm/get_parameters" _) -> pure ()
        _ -> expectationFailure (show end)
    it "reads its answer where an interruption can end that" . withService (answering 0) $ \_ ros ->
      call ros (service "/lights" :: Service Reading) Null >>= (`shouldBe` Masked Unmasked)
    it "faults at once when the link is lost" . withService (answering 3) $ \robot ros -> do
      end <- firstOf [sleep 1 >> loseLink robot >> sleepForever, inSeconds 1 (try (call ros lights Null))]
      end `shouldBe` Left (LinkLost "the fake robot" "user error (connection lost)")
    it "fails when there is no link in time" . withService (answering 3) $ \robot ros -> do
      loseLink robot
      Signal.waitUntil (not <$> linkUp ros)
      inSeconds 5 (try (call ros lights Null)) >>= (`shouldBe` Left noLink)
    it "returns at once when it is interrupted" . withService (answering 3) $ \_ ros ->
      inSeconds 1 (stopAfter 1 (call ros lights Null)) >>= (`shouldBe` Nothing)

    it "has the first of several answers, whatever comes after it" $ do
      ros <- newRos "nowhere" "" defaultRosOptions
      reply <- newTVarIO Nothing
      atomically $ do
        _ <- comeUp ros 0
        writeTVar (calls ros) (Map.singleton "call 1" reply)
        Receive.take ros 0 100 (Response "call 1" True "on")
        Receive.take ros 0 100 (Response "call 1" False "off")
        Receive.take ros 0 100 (Complaint (Just "call 1") "no")
        goDown ros "the bridge has ended"
      readTVarIO reply >>= \case
        Just (Answered answer) -> answer `shouldBe` "on"
        _ -> expectationFailure "another answer"

  describe "What is asked" $
    it "throws where it is used, if it throws: the link stays" . withService (answering 0) $ \_ ros -> do
      Signal.waitUntil (linkUp ros)
      let broken = object ["data" .= (throw Overflow :: Int)]
          overflows act = do
            try act >>= either (`shouldBe` Overflow) (const (expectationFailure "it returned"))
            sleep 1
      overflows (void (call ros lights broken))
      overflows (void (carrying ros (throw Overflow)))
      overflows (void (goal ros carry broken))
      overflows (publishing ros (untypedPublication "/speed" "my_robot/msg/Speed") ($ broken))
      overflows (publishing ros (untypedPublication (throw Overflow) "my_robot/msg/Speed") (\_ -> pure ()))
      overflows (void (Signal.read (latest ros (topic ['/', throw Overflow] latched :: Topic Value))))
      Signal.read (linkUp ros) >>= (`shouldBe` True)

  describe "A parameter" $ do
    it "has its value" . withService (answering 0) $ \robot ros -> do
      let known name = [double 0.5 | name == object ["names" .= ["speed" :: Text]]]
      offerService robot "/arm/get_parameters" (\asked -> says (Right (object ["values" .= known asked])) asked)
      getParameter ros "/arm" "speed" >>= (`shouldBe` DoubleValue 0.5)
      try (getParameter ros "/arm" "reach")
        >>= (`shouldBe` Left (ServiceFailed "/arm" "there is no parameter reach with a value"))
    it "is set, or fails with the reason" . withService (answering 0) $ \robot ros -> do
      let outcome ok why = object ["results" .= [object ["successful" .= ok, "reason" .= (why :: Text)]]]
          slow = object ["parameters" .= [object ["name" .= ("speed" :: Text), "value" .= double 0.5]]]
          judge asked = if asked == slow then outcome True "" else outcome False "too fast"
      offerService robot "/arm/set_parameters" (\asked -> says (Right (judge asked)) asked)
      setParameter ros "/arm" "speed" (DoubleValue 0.5)
      try (setParameter ros "/arm" "speed" (DoubleValue 2))
        >>= (`shouldBe` Left (ServiceFailed "/arm" "it does not set speed: too fast"))

  describe "Publishing" $ do
    it "is advertised as long as anyone publishes" . withRobot $ \robot ros -> do
      let saying n = publishing ros speeds $ \say -> say (Std (Just n)) >> sleep 2
      saying 1 `both` (sleep 1 >> saying 2)
      sleep 1
      published robot
        >>= (`shouldBe` [(0, Advertised "/speed"), (0, said 1), (1, said 2), (3, Unadvertised "/speed")])
    it "is advertised again after a loss of the link, and nothing is sent late" . withRobot $ \robot ros -> do
      Signal.waitUntil (linkUp ros)
      publishing ros speeds $ \say -> do
        say (Std (Just 1)) >> sleep 1
        loseLink robot
        Signal.waitUntil (not <$> linkUp ros)
        stopAfter 1 (say (Std (Just 2))) >>= (`shouldBe` Nothing)
        restoreLink robot
        say (Std (Just 3))
      sleep 1
      events <- map snd <$> published robot
      events `shouldBe` [Advertised "/speed", said 1, Advertised "/speed", said 3, Unadvertised "/speed"]
    it "fails when there is no link in time" . withRobot $ \robot ros -> do
      loseLink robot
      Signal.waitUntil (not <$> linkUp ros)
      inSeconds 5 (try (publishing ros speeds ($ Std (Just 1))))
        >>= (`shouldBe` Left noLink)
    it "needs a type, and only one" . withRobot $ \_ ros -> do
      errorOf (publishing ros (publication "/x") ($ Null))
        >>= (`shouldBe` "publishing: /x needs the name of its type (messageType, or untypedPublication)")
      let other = untypedPublication "/speed" "std_msgs/msg/String"
      errorOf (publishing ros speeds (\_ -> publishing ros other (\_ -> pure ())))
        >>= (`shouldBe` "publishing: /speed is published already, as std_msgs/msg/Float64")

  describe "Stopping all goals" $ do
    it "returns when the robot says they have ended" . underSchedules 40 . mission (const slowly) $ \robot ros -> do
      let others = try (carrying ros "cup")
          stopping = sleep 1 >> inSeconds 0.5 (stopAll ros carry) >> atomically (runningGoals robot)
      both
        (others >>= (`shouldBe` Left (CancelledByOther "/carry")))
        (stopping >>= (`shouldBe` []))
    it "is a fault if the robot does not say that in time" . underSchedules 40 . mission (const deaf) $ \robot ros -> do
      let runs = atomically (runningGoals robot >>= check . (== [1]))
          moving = firstOf [void (carrying ros "cup"), runs >> sleep 1]
      void (tried moving)
      tried (inSeconds 2 (stopAll ros carry)) >>= (`shouldBe` Left unconfirmed)
    it "of a server that is not there fails" . underSchedules 40 . mission (const slowly) $ \_ ros ->
      try (stopAll ros (untyped "/fly" ""))
        >>= (`shouldBe` Left (ServiceFailed "/fly/_action/cancel_goal" "there is no such service"))
    it "returns when none runs: if there never was one, after its patience" . withNamed brief $ \_ ros -> do
      inSeconds 2 (stopAll ros carry)
      void (carrying ros "cup")
      inSeconds 0 (stopAll ros carry)
    it "clears those left behind that have ended: here the result was too large" . withNamed large $ \_ ros -> do
      tried (stopAfter 5 (carrying ros "table")) >>= (`shouldBe` Left (NotConfirmed "/carry" noneRuns))
      try (carrying ros "cup") >>= (`shouldBe` Left (StillMoving "/carry"))
      stopAll ros carry
      void (carrying ros "cup")
    it "returns if the server has crashed, and is there again: what it has said before does not count" $
      withNamed brief $ \robot ros -> do
        stopAll ros carry
        robot `hasSaid` [("one", 2)]
        inSeconds 2 (stopAll ros carry)
        void (carrying ros "cup")
    it "asks the server what runs: what comes late does not count" . underSchedules 40 . mission (const deaf) $
      \robot ros -> do
        void (tried (stopAfter 5 (carrying ros "cup")))
        robot `hasSaid` []
        tried (inSeconds 2 (stopAll ros carry)) >>= (`shouldBe` Left unconfirmed)
    it "does not clear what may not have come yet" . withNamed late $ \robot ros -> do
      void (carrying ros "cup")
      let breaks = sleep 0.1 >> loseLink robot >> sleep 0.1 >> restoreLink robot
      void (tried (carrying ros "table")) `both` breaks
      Signal.waitUntil (linkUp ros)
      stopAll ros carry
      Signal.read (movingGoals ros) >>= (`shouldBe` 1)

  describe "A namespace" $
    it "is that of relative names, and nests" . withRobot $ \robot ros -> do
      let one say = say (Std (Just (1 :: Double)))
          arm = inNamespace "arm" (inNamespace "/robot1/" ros)
      publishing arm (publication "speed") one
      publishing arm (publication "/speed") one
      publishing ros (publication "speed") one
      sleep 1
      names <- published robot
      [name | (_, Advertised name) <- names] `shouldBe` ["/robot1/arm/speed", "/speed", "/speed"]
 where
  lights = untypedService "/lights" "std_srvs/srv/SetBool"
  speeds = publication "/speed" :: Publication (Std (Maybe Double))
  unconfirmed = NotConfirmed "/carry" "its server has not said that they have ended"
  noneRuns = "its server says that none of its goals runs"
  -- (As a new subscriber does not receive it.)
  robot `hasSaid` goals = do
    sendBytes robot (encodeAnswer (Message "/carry/_action/status" (toRos (Statuses goals))))
    sleep 0.1
  brief = []
  large = [("table", succeeding {endsWith = Succeeds (String (Text.replicate 5000 "x"))})]
  late = [("table", succeeding {acceptedAfter = 1})]
  withNamed scripts = underSchedules 40 . missionWith small (named scripts)
  small = defaultRosOptions {frameBytes = 4000, pingEvery = 10}
  deaf = slowly {confirmsAfter = 1 / 0}
  withService script act = underSchedules 40 . onRobot $ \robot ros ->
    offerService robot "/lights" script >> act robot ros
  withRobot = underSchedules 40 . onRobot
  onRobot act = withFakeRobot [] $ \robot ->
    withRosOptions defaultRosOptions {pingEvery = 10} (fakeRos robot) (act robot)
  later wanted = case wanted of
    Number n -> ServiceScript (realToFrac n) (Right wanted)
    _ -> ServiceScript 0 (Right Null)
  says answer _ = ServiceScript 0 answer
  double n = object ["type" .= (3 :: Int), "double_value" .= (n :: Double)]
  said n = Published "/speed" (object ["data" .= (n :: Double)])
  published robot = filter (concerns . snd) <$> atomically (seen robot)
  concerns what = case what of
    Advertised _ -> True
    Unadvertised _ -> True
    Published _ _ -> True
    _ -> False
  errorOf act = either (\(ErrorCall text) -> text) (const "it returned") <$> try act
  tried :: Behavior a -> Behavior (Either RosFault a)
  tried = try

-- | A service whose answers say how they were read.
data Reading

instance RosService Reading where
  type Question Reading = Value
  type Answer Reading = Masked
  serviceType _ = "std_srvs/srv/SetBool"
