{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE TypeFamilies #-}

-- |
-- Goals of a robot that is at the other end of a link.
module Ros.GoalSpec (spec) where

import Control.Exception (MaskingState (Unmasked), finally, throwIO, try)
import Control.Monad (void)
import Data.Aeson (Value (..), object, (.=))
import Data.IORef
import Data.List (isPrefixOf)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Action
import Behavior.Ros.Fake
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Sim (events, simulate)
import Behavior.Time
import Behavior.Trace hiding (named)
import Ros.Stage
import Support (guarded)

spec :: Spec
spec = guarded $ do
  describe "A goal" $ do
    it "gives its result" . underSchedules 40 . mission (const succeeding {endsWith = Succeeds "a cup"}) $
      \_ ros -> inSeconds 1 (carrying ros "cup") >>= (`shouldBe` "a cup")
    it "fails as it ended: by its status, whatever the field \"result\" says" $ do
      let ends how = mission (const succeeding {endsWith = how}) (\_ ros -> try (carrying ros "cup"))
          endsAs how failure = underSchedules 40 (ends how >>= (`shouldBe` Left failure))
      Aborts (object ["grams" .= (9000 :: Int)]) `endsAs` Aborted "/carry" "{\"grams\":9000}"
      Cancels `endsAs` CancelledByOther "/carry"
      Refuses `endsAs` Rejected "/carry" "the goal was not accepted"
    it "is rejected by a bridge that complains about it" . underSchedules 40 . mission (const succeeding) $ \_ ros ->
      try (goal ros (untyped "/fly" "my_robot/action/Fly") Null)
        >>= (`shouldBe` Left (Rejected "/fly" "there is no action /fly"))
    it "faults if its result is not what is expected" . underSchedules 40 . mission (const succeeding) $ \_ ros ->
      tried (goal ros (action "/carry" :: Action Counting) 3)
        >>= (`shouldBe` Left (Undecodable "/carry" "Error in $: this is no number"))
    it "reads its result where an interruption can end that" . underSchedules 40 . mission (const succeeding) $
      \_ ros ->
        goal ros (action "/carry" :: Action Reading) Null >>= (`shouldBe` Masked Unmasked)
    it "fails when there is no link in time" . underSchedules 40 . mission (const succeeding) $ \robot ros -> do
      awaitUp ros
      loseLink robot
      Signal.waitUntil (not <$> linkUp ros)
      inSeconds 5 (try (carrying ros "cup")) >>= (`shouldBe` Left noLink)
    it "waits for a link that comes in time" . underSchedules 40 $
      withFakeRobot [("/carry", const succeeding)] $ \robot -> do
        loseLink robot
        (sleep 3 >> restoreLink robot) `both` withRos (fakeRos robot) (\ros -> void (carrying ros "cup"))
    it "shows its feedback to a behaviour beside it" . underSchedules 40 $ do
      let script = slowly {feedbacks = [(1, Number 5), (1, Number 2), (1, Number 0.5)]}
          near distance = case distance of
            Number n -> n < 1
            _ -> False
      mission (const script) $ \_ ros -> do
        seenAt <- newIORef 0
        _ <- goalWith ros carry "cup" (\feedback -> Signal.waitUntil (near <$> feedback) >> now >>= writeIORef seenAt)
        (,) <$> readIORef seenAt <*> now >>= (`shouldBe` (3, 60))
    it "is stopped when the behaviour beside it fails" . underSchedules 40 . mission (const slowly) $ \robot ros -> do
      void (goalWith ros carry "cup" (\_ -> sleep 5 >> failed)) ? pure ()
      robot `has` []

  describe "A goal that is stopped" $ do
    it "ends only when the robot has confirmed that it has stopped" . underSchedules 150 . mission (const slowly) $
      \robot ros -> do
        inSeconds 10.5 (stopAfter 10 (carrying ros "cup")) >>= (`shouldBe` Nothing)
        robot `has` []
    it "has stopped before a recovery starts" . underSchedules 150 . mission (const slowly) $ \robot ros -> do
      low <- newTVarIO False
      let recharge = robot `has` [] >> atomically (writeTVar low False)
          empties = sleep 5 >> atomically (writeTVar low True)
      empties `both` Signal.monitor (Signal.watching (readTVar low)) recharge (void (carrying ros "cup"))
    it "is confirmed also when the link's own behaviour is stopped" . underSchedules 150 $
      withFakeRobot [("/carry", const slowly)] $ \robot -> do
        _ <- inSeconds 10.5 (stopAfter 10 (withRos (fakeRos robot) (`carrying` "cup")))
        robot `has` []
    it "is cancelled again when it had not been accepted, and a complaint is not its end" . underSchedules 150 $
      mission (const slowly {acceptedAfter = 0.1}) $ \robot ros -> do
        awaitUp ros
        _ <- inSeconds 0.601 (stopAfter 0.001 (carrying ros "cup"))
        robot `has` []
        came <- atomically (seen robot)
        -- (At 0, 20, 40, 60 and 80 ms; at 100 ms; and at 140, 220, 380 and 580 ms until it is confirmed.)
        [accepted | (_, CancelCame 1 accepted) <- came] `shouldBe` replicate 5 False ++ replicate 5 True
    it "that succeeds all the same is interrupted, too: what comes after it does not run" . underSchedules 150 $
      mission (const slowly {confirmsWith = Succeeds "a cup"}) $ \robot ros -> do
        inSeconds 10.5 (stopAfter 10 (carrying ros "cup" >> carrying ros "pot")) >>= (`shouldBe` Nothing)
        came <- atomically (seen robot)
        length [() | (_, GoalCame {}) <- came] `shouldBe` 1
    it "that is aborted meanwhile has stopped" . underSchedules 40 $
      mission (const slowly {confirmsWith = Aborts (object [])}) $ \_ ros ->
        inSeconds 10.5 (stopAfter 10 (carrying ros "cup")) >>= (`shouldBe` Nothing)

  describe "A goal whose stop is not confirmed" $ do
    it "is a fault when the patience has ended" . underSchedules 150 . mission (const stubborn) $ \_ ros ->
      inSeconds 12 (tried (stopAfter 10 (carrying ros "cup"))) >>= (`shouldBe` Left (NotConfirmed "/carry" cancelling))
    it "is not caught by what handles faults: the stop goes on" . underSchedules 150 . mission (const stubborn) $
      \_ ros -> do
        goesOn <- newIORef False
        end <- tried (stopAfter 10 (carrying ros "cup" `catchAny` \_ -> "" <$ writeIORef goesOn True))
        end `shouldBe` Left (NotConfirmed "/carry" cancelling)
        readIORef goesOn >>= (`shouldBe` False)
    it "is one that names a bridge that works on requests only when no goal runs" . underSchedules 40 $
      mission (const slowly) $ \robot ros -> do
        workSerially robot
        end <- inSeconds 12 (tried (stopAfter 10 (carrying ros "cup")))
        case end of
          Left (NotConfirmed "/carry" why) -> why `shouldContain` "909"
          _ -> expectationFailure (show end)
    it "makes new ones be refused, until it has ended" . underSchedules 40 . mission (const stubborn) $ \robot ros -> do
      _ <- tried (stopAfter 10 (carrying ros "cup"))
      Signal.read (movingGoals ros) >>= (`shouldBe` 1)
      try (carrying ros "pot") >>= (`shouldBe` Left (StillMoving "/carry"))
      robot `has` [1]
      sleep 50
      Signal.read (movingGoals ros) >>= (`shouldBe` 0)
      void (carrying ros "pot")
    it "does not make one be refused that replaces it; whose result is not that of the other" . underSchedules 40 $ do
      let scripts = [("cup", stubborn {endsWith = Succeeds "a cup"}), ("pot", slowly {endsWith = Succeeds "a pot"})]
      mission (named scripts) $ \robot ros -> do
        _ <- tried (stopAfter 10 (carrying ros "cup"))
        -- (The cup's result comes 12 s before that of the pot.)
        goal ros (replacing carry) "pot" >>= (`shouldBe` "a pot")
        robot `has` []
    it "makes one that is still awaited be refused, too" . underSchedules 40 . mission (const slowly) $ \_ ros -> do
      awaitUp ros
      let second = sleep 5 >> try (carrying ros "pot") >>= (`shouldBe` Left (StillMoving "/carry"))
      second `both` void (carrying ros "cup")
    it "is not one whose result has another id" . underSchedules 40 . mission (const slowly) $ \robot ros -> do
      let lie = sleep 5 >> sendBytes robot "{\"op\":\"action_result\",\"id\":\"goal 7\",\"status\":4}"
      lie `both` (inSeconds 60 (carrying ros "cup") >>= (`shouldBe` object []))

  describe "When the link is lost" $ do
    it "a goal faults at once, and its cleanups run" . underSchedules 150 . mission (const slowly) $ \robot ros -> do
      parked <- newIORef False
      let act = inSeconds 10 (tried (carrying ros "cup" `finally` writeIORef parked True))
      lost <- firstOf [sleep 10 >> loseLink robot >> sleepForever, act]
      lost `shouldBe` Left linkLost
      readIORef parked >>= (`shouldBe` True)
    it "a goal that is being cancelled faults at once" . underSchedules 99 . mission (const stubborn) $ \robot ros -> do
      let act = inSeconds 10.5 (tried (stopAfter 10 (carrying ros "cup")))
      lost <- firstOf [sleep 10.5 >> loseLink robot >> sleepForever, act]
      lost `shouldBe` Left linkLost
    it "a goal that its server accepts after a new connection is not taken for an ended one" . underSchedules 40 $
      lostBeforeItIsAccepted $ \robot ros -> do
        sleep 0.5
        try (carrying ros "pot") >>= (`shouldBe` Left (StillMoving "/carry"))
        Signal.waitUntil ((== 0) <$> movingGoals ros)
        atomically (runningGoals robot) >>= (`shouldBe` [])
    it "a goal is not taken for an ended one by what was said before the link froze" . underSchedules 40 $
      lostBeforeItIsAccepted $ \robot ros -> do
        sleep 0.5 >> freezeLink robot >> sleep 2
        Signal.read (movingGoals ros) >>= (`shouldBe` 1)
    it "the robot is asked again whether the old goal runs, if a new bridge has not said" . underSchedules 40 $
      mission (const succeeding {endsAfter = 3}) $ \robot ros -> do
        let losing = sleep 1 >> loseLink robot >> sleepForever
        _ <- firstOf [losing, tried (carrying ros "cup") <* sleep 5]
        -- (What is sent to the new bridge at once is lost.)
        restoreLink robot >> freezeLink robot
        Signal.waitUntil (linkUp ros)
        sleep 0.1 >> restoreLink robot
        timeout 10 (Signal.waitUntil ((== 0) <$> movingGoals ros))
    it "goals are not sent again, and new ones are refused while the old one runs" . underSchedules 80 $
      mission (const slowly) $ \robot ros -> do
        let losing = sleep 10 >> loseLink robot >> sleep 5 >> restoreLink robot >> sleepForever
        _ <- firstOf [losing, tried (carrying ros "cup") <* sleep 10]
        awaitUp ros
        robot `has` [1]
        try (carrying ros "pot") >>= (`shouldBe` Left (StillMoving "/carry"))
        came <- atomically (seen robot)
        length [() | (_, GoalCame {}) <- came] `shouldBe` 1
        sleep 45
        robot `has` []
        void (carrying ros "pot")
    it "what was not sent yet is never sent" . underSchedules 100 . mission (const slowly) $ \robot ros -> do
      awaitUp ros
      void (tried (loseLink robot ||| carrying ros "cup"))
      sleep 5 >> restoreLink robot >> awaitUp ros >> sleep 1
      came <- atomically (seen robot)
      [time | (time, GoalCame {}) <- came, time > 0] `shouldBe` []
    it "a status without goals does not concern a goal that was sent since" . underSchedules 80 $
      mission (named [("cup", slowly), ("pot", slowly {endsAfter = 90})]) $ \robot ros -> do
        let losing = sleep 10 >> loseLink robot >> sleep 5 >> restoreLink robot >> sleepForever
        _ <- firstOf [losing, tried (carrying ros "cup") <* sleep 10]
        awaitUp ros
        let none = sleep 5 >> publish robot "/carry/_action/status" (object ["status_list" .= ([] :: [Value])])
        none `both` inSeconds 90 (void (goal ros (replacing carry) "pot"))
    it "a new goal is sent after it if the old one has ended meanwhile" . underSchedules 80 $
      mission (const slowly) $ \robot ros -> do
        let losing = sleep 10 >> loseLink robot >> sleep 55 >> restoreLink robot >> sleepForever
        _ <- firstOf [losing, tried (carrying ros "cup") <* sleep 60]
        void (carrying ros "pot")

  describe "In a trace" $ do
    let spansOf run = [(spanName s, spanBegan s, time, how) | Ended s time how <- events run, about (spanName s)]
        about name = any (`isPrefixOf` name) ["goal", "may still move"]
        -- What was noticed: when, and the name of the span around it.
        noticedIn run =
          [ (reactionOperator r, reactionTime r, spansAround run (reactionParent r), reactionChanges r)
          | Reacted r <- events run
          , reactionOperator r == "goal"
          ]
        spansAround run parent = [spanName s | Began s <- events run, parent == Inside (spanNumber s)]
    it "a goal is a span with its outcome, in which its id is noticed" $ do
      run <- simulate . mission (const slowly) $ \_ ros -> awaitUp ros >> stopAfter 10 (carrying ros "cup") >> sleep 1
      [(name, began, end) | (name, began, end, _) <- spansOf run] `shouldBe` [("goal: /carry", 0, 10.5)]
      [() | (_, _, _, StoppedBy _) <- spansOf run] `shouldBe` [()]
      noticedIn run `shouldBe` [("goal", 0, ["goal: /carry"], [Change "id" Nothing "goal 1"])]
    it "a goal that does not stop is a span of its own until it has ended, and has its id" $ do
      run <- simulate . mission (const stubborn) $ \_ ros -> do
        awaitUp ros
        _ <- tried (stopAfter 10 (carrying ros "cup"))
        sleep 60
      [(name, began, end) | (name, began, end, Succeeded) <- spansOf run]
        `shouldBe` [("may still move: /carry", 12, 60)]
      [(time, outside, changes) | ("goal", time, outside, changes) <- noticedIn run, time > 0]
        `shouldBe` [(12, ["may still move: /carry"], [Change "id" Nothing "goal 1"])]
    it "so is one whose link was lost, until the robot says that it runs no longer" $ do
      run <- simulate . mission (const slowly) $ \robot ros -> do
        awaitUp ros
        let losing = sleep 10 >> loseLink robot >> sleep 5 >> restoreLink robot >> sleepForever
        _ <- firstOf [losing, tried (carrying ros "cup")]
        sleep 5 >> restoreLink robot >> sleep 60
      [(name, began, end) | (name, began, end, Succeeded) <- spansOf run]
        `shouldBe` [("may still move: /carry", 10, 60)]

-- | An action whose goals and results are numbers.
data Counting

instance RosAction Counting where
  type Goal Counting = Double
  type Result Counting = Double
  type Feedback Counting = Double
  actionType _ = "my_robot/action/Count"

-- | An action whose results say how they were read.
data Reading

instance RosAction Reading where
  type Goal Reading = Value
  type Result Reading = Masked
  type Feedback Reading = Value
  actionType _ = "my_robot/action/Carry"

-- | A goal whose link is lost 1.4 s before its server accepts it, and is there again. (The server has accepted one
-- before, so that it has a status.)
lostBeforeItIsAccepted :: (FakeRobot -> Ros -> Behavior a) -> Behavior a
lostBeforeItIsAccepted act =
  mission (named [("first", succeeding), ("cup", succeeding {acceptedAfter = 1.5, endsAfter = 8})]) $ \robot ros -> do
    void (carrying ros "first")
    let losing = sleep 0.1 >> loseLink robot >> sleep 0.3 >> restoreLink robot >> sleepForever
    _ <- firstOf [losing, tried (carrying ros "cup") <* awaitUp ros]
    act robot ros

-- | Takes a minute, and does not stop.
stubborn :: GoalScript
stubborn = slowly {confirmsAfter = 1 / 0}

-- | What is known of its server then.
cancelling :: String
cancelling = "its server says that a goal is being cancelled"

linkLost :: RosFault
linkLost = LinkLost "the fake robot" "user error (connection lost)"

tried :: Behavior a -> Behavior (Either RosFault a)
tried = try

awaitUp :: Ros -> Behavior ()
awaitUp = Signal.waitUntil . linkUp

-- | These goals run on the robot.
has :: FakeRobot -> [Int] -> Behavior ()
has robot expected = atomically (runningGoals robot) >>= \running ->
  if running == expected then pure () else throwIO (userError ("goals on the robot: " ++ show running))
