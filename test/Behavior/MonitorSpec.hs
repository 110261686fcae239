-- |
-- 'Signal.monitor' on conditions that are watched: its latch, and what may interrupt
-- what. What it has in common with the other operators is in "Behavior.ReactiveSpec",
-- and how it ends when several things happen in "Behavior.OutcomeSpec".
module Behavior.MonitorSpec (spec) where

import Control.Concurrent (yield)
import Control.Concurrent.Async (asyncThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (replicateM_, unless, void)
import Data.Foldable (for_)
import Test.Hspec
import Test.Hspec.QuickCheck (modifyMaxSize, prop)
import Test.QuickCheck (NonNegative (..), ioProperty, (===))

import Behavior ((|||))
import Behavior.Internal.Runtime (atomically, sleep)
import Behavior.Parallel (firstOf)
import qualified Behavior.Signal as Signal
import Behavior.Sim (Run (outcome), explain, simulate)
import Support
import Watched

spec :: Spec
spec = guarded . describe "monitor" $ do
  it "reads the condition first: when it is true, the recovery runs before the task" $ do
    book <- newLog
    condition <- newTestCondition True
    let recovery = note book "recovery" >> set condition (Says False)
    Signal.monitor (watched condition) recovery (note book "task")
    notes book `shouldReturn` ["recovery", "task"]

  -- The task asks for as many recoveries in a row as the script says, again and again.
  modifyMaxSize (const 15) . prop "recovers until the condition is false, and begins the task anew" $ \script ->
    ioProperty $ do
      book <- newLog
      left <- newTVarIO (map getNonNegative script :: [Int])
      needed <- newTVarIO 0
      let task = do
            note book "task"
            over <- atomically $ do
              counts <- readTVar left
              writeTVar left (drop 1 counts)
              null counts <$ for_ (take 1 counts) (writeTVar needed . (+ 1))
            unless over hang
          recovery = note book "recovery" >> atomically (modifyTVar' needed (subtract 1))
      Signal.monitor ((> 0) <$> dialled needed) recovery task
      let expected = concatMap (\(NonNegative n) -> "task" : replicate (n + 1) "recovery") script
      (expected ++ ["task"] ===) <$> notes book

  for_ [("is done twice, when it is the result of an inner operator", False), ("is done once, when the branch itself records it", True)] $
    \(often, recording) -> it ("work that is interrupted between its end and an inner operator's return " ++ often) $ do
      book <- newLog
      low <- newTVarIO False
      done <- newTVarIO False
      let deliver = sleep 1 >> note book "deliver"
          once = atomically (readTVar done) >>= \is -> unless is . mask_ $ deliver >> atomically (writeTVar done True)
          phone = hang `uninterruptibly` sleep 2
          mission = Signal.whileHolding (pure True) (firstOf [if recording then once else deliver, phone])
          charge = note book "charge" >> atomically (writeTVar low False)
      run <- simulate (Signal.monitor (dialled low) charge mission ||| (sleep 2 >> atomically (writeTVar low True) >> hang))
      explain (outcome run) `shouldBe` "it returned"
      notes book `shouldReturn` (if recording then ["deliver", "charge"] else ["deliver", "charge", "deliver"])

  it "recovers even if the condition is false again when the task has ended" $ do
    book <- newLog
    condition <- newTestCondition False
    entered <- newGate
    let task = do
          again <- (/= []) <$> notes book
          note book "task"
          unless again $ (open entered >> hang) `onException` set condition (Says False)
    launching (Signal.monitor (watched condition) (note book "recovery") task) $ \caller -> do
      pass entered
      set condition (Says True)
      awaitEnd caller `shouldReturn` Gave ()
    notes book `shouldReturn` ["task", "recovery", "task"]

  it "starts the recovery only after the task, cleanup included, has ended" $ do
    book <- newLog
    condition <- newTestCondition False
    entered <- newGate
    cleaning <- newGate
    release <- newGate
    let task = do
          again <- (/= []) <$> notes book
          unless again $ do
            note book "task"
            (open entered >> hang) `onException` do
              open cleaning
              pass release
              note book "task is over"
        recovery = note book "recovery" >> set condition (Says False)
    launching (Signal.monitor (watched condition) recovery task) $ \caller -> do
      pass entered
      set condition (Says True)
      pass cleaning
      stillRunning caller
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes book `shouldReturn` ["task", "task is over", "recovery"]

  it "runs the recovery to completion, whatever the condition says meanwhile" $ do
    book <- newLog
    condition <- newTestCondition True
    entered <- newGate
    release <- newGate
    let recovery =
          (open entered >> pass release >> note book "recovered")
            `onException` note book "interrupted"
        task = note book "task"
    launching (Signal.monitor (watched condition) recovery task) $ \caller -> do
      pass entered
      for_ [Says False, Says True, SaysFailure, SaysFault, SaysNothing, Says False] $ \news -> do
        set condition news
        stillRunning caller
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes book `shouldReturn` ["recovered", "task"]

  for_ [SaysFailure, SaysFault, SaysNothing] $ \news ->
    it ("starts nothing when after the recovery the condition says " ++ show news) $ do
      book <- newLog
      condition <- newTestCondition True
      let recovery = note book "recovery" >> set condition news
      end <- ending (Signal.monitor (watched condition) recovery (note book "task"))
      end `shouldBe` case news of
        SaysFailure -> FailedWith "FailedBecause \"the sensor\""
        SaysFault -> FaultedWith (show (Fault "the sensor"))
        _ -> FailedWith "FailedBecause \"the signal has no value any more\""
      notes book `shouldReturn` ["recovery"]

  it "never runs task and recovery at once, however often it recovers" $ do
    occupancy <- newOccupancyCounter
    condition <- newTVarIO False
    works <- newTVarIO False
    over <- newGate
    let task =
          inside occupancy $
            (atomically (writeTVar works True) >> pass over)
              `onException` (replicateM_ 3 yield >> atomically (writeTVar works False))
        recovery = inside occupancy (replicateM_ 3 yield >> atomically (writeTVar condition False))
    launching (Signal.monitor (dialled condition) recovery task) $ \caller -> do
      for_ [1 .. 500 :: Int] $ \n -> do
        atomically (writeTVar condition True)
        -- Two times of three the task may come to run.
        unless (n `mod` 3 == 0) . atomically $
          (&&) <$> readTVar works <*> (not <$> readTVar condition) >>= check
      open over
      awaitEnd caller `shouldReturn` Gave ()
    mostInside occupancy `shouldReturn` 1

  it "interrupts, as the outer one, the recovery of an inner one" $ do
    book <- newLog
    danger <- newTestCondition False
    low <- newTestCondition True
    entered <- newGate
    let flee = note book "flee" >> set danger (Says False)
        recharge = do
          again <- (/= []) <$> notes book
          note book "recharge"
          unless again ((open entered >> hang) `onException` note book "unplug")
          set low (Says False)
        task = note book "task"
        inner = Signal.monitor (watched low) recharge task
    launching (Signal.monitor (watched danger) flee inner) $ \caller -> do
      pass entered
      set danger (Says True)
      awaitEnd caller `shouldReturn` Gave ()
    notes book `shouldReturn` ["recharge", "unplug", "flee", "recharge", "task"]

  it "does not let an inner one interrupt the recovery of the outer one" $ do
    book <- newLog
    danger <- newTestCondition False
    low <- newTestCondition False
    let flee = do
          note book "flee"
          set low (Says True)
          note book "safe"
          set danger (Says False)
        recharge = note book "recharge" >> set low (Says False)
        task = do
          again <- (> 1) . length <$> notes book
          note book "task"
          unless again (set danger (Says True) >> hang)
    Signal.monitor (watched danger) flee (Signal.monitor (watched low) recharge task)
    notes book `shouldReturn` ["task", "flee", "safe", "recharge", "task"]

  for_ [minBound .. maxBound] $ \how ->
    it ("is cancelled, when its recovery then " ++ manner how) $ do
      book <- newLog
      condition <- newTestCondition True
      entered <- newGate
      let recovery = void $ onStop how "recovery" (open entered >> hang)
          act = leavingNothing (Signal.monitor (watched condition) recovery (note book "task"))
      cancelling act (pass entered) `shouldReturn` case how of
        Faulting -> CancelledWithFault (show (Cancel "the caller")) (show (Fault "recovery"))
        _ -> CancelledBy (show (Cancel "the caller"))
      notes book `shouldReturn` []

  it "does not recover when it is cancelled while the task stops" $ do
    book <- newLog
    condition <- newTestCondition False
    entered <- newGate
    cleaning <- newGate
    release <- newGate
    let task =
          (open entered >> hang) `onException` do
            open cleaning
            -- Interruptible; but nobody asks a second time.
            pass release
            note book "task is over"
    launching (Signal.monitor (watched condition) (note book "recovery") task) $ \caller -> do
      pass entered
      set condition (Says True)
      pass cleaning
      -- It is delivered when this returns: the caller waits where it can be interrupted.
      throwTo (asyncThreadId caller) (Cancel "the caller")
      open release
      awaitEnd caller `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())
    notes book `shouldReturn` ["task is over"]
 where
  manner how = case how of
    Cleanly -> "stops"
    Completing -> "completes all the same"
    Failing -> "fails"
    Faulting -> "faults: with both"
