-- |
-- 'Signal.monitor' on watched conditions: its latch, and which behaviour may interrupt
-- which. Its promises in common with the other operators are in "Behavior.ReactiveSpec",
-- and how it ends when several things happen is in "Behavior.OutcomeSpec".
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
import Behavior.Internal.Seam.Runtime (atomically, sleep)
import Behavior.Parallel (firstOf)
import qualified Behavior.Signal as Signal
import Behavior.Sim (Run (outcome), explain, simulate)
import Support
import Watched

spec :: Spec
spec = guarded . describe "monitor" $ do
  it "reads the condition first: when it is true, the recovery runs before the task" $ do
    entries <- newLog
    condition <- newTestCondition True
    let recovery = note entries "recovery" >> set condition (Value False)
    Signal.monitor (watched condition) recovery (note entries "task")
    notes entries `shouldReturn` ["recovery", "task"]

  -- Each run of the task requires the next number of consecutive recoveries of the script.
  modifyMaxSize (const 15) . prop "recovers until the condition is false, and restarts the task" $ \script ->
    ioProperty $ do
      entries <- newLog
      left <- newTVarIO (map getNonNegative script :: [Int])
      needed <- newTVarIO 0
      let task = do
            note entries "task"
            over <- atomically $ do
              counts <- readTVar left
              writeTVar left (drop 1 counts)
              null counts <$ for_ (take 1 counts) (writeTVar needed . (+ 1))
            unless over hang
          recovery = note entries "recovery" >> atomically (modifyTVar' needed (subtract 1))
      Signal.monitor ((> 0) <$> watchedVar needed) recovery task
      let expected = concatMap (\(NonNegative n) -> "task" : replicate (n + 1) "recovery") script
      (expected ++ ["task"] ===) <$> notes entries

  for_
    [ ("is done twice, when it is the result of an inner operator", False)
    , ("is done once, when the branch itself records it", True)
    ]
    $ \(often, recording) ->
      it ("work that is interrupted between its end and an inner operator's return " ++ often) $ do
        entries <- newLog
        low <- newTVarIO False
        done <- newTVarIO False
        let deliver = sleep 1 >> note entries "deliver"
            once = atomically (readTVar done) >>= \is -> unless is . mask_ $ deliver >> atomically (writeTVar done True)
            phone = hang `uninterruptibly` sleep 2
            mission = Signal.whileHolding (pure True) (firstOf [if recording then once else deliver, phone])
            charge = note entries "charge" >> atomically (writeTVar low False)
        let falls = sleep 2 >> atomically (writeTVar low True) >> hang
        run <- simulate (Signal.monitor (watchedVar low) charge mission ||| falls)
        explain (outcome run) `shouldBe` "it returned"
        notes entries `shouldReturn` (if recording then ["deliver", "charge"] else ["deliver", "charge", "deliver"])

  it "recovers even if the condition is false again when the task has ended" $ do
    entries <- newLog
    condition <- newTestCondition False
    entered <- newGate
    let task = do
          again <- (/= []) <$> notes entries
          note entries "task"
          unless again $ (open entered >> hang) `onException` set condition (Value False)
    withThread (Signal.monitor (watched condition) (note entries "recovery") task) $ \caller -> do
      pass entered
      set condition (Value True)
      awaitEnd caller `shouldReturn` Gave ()
    notes entries `shouldReturn` ["task", "recovery", "task"]

  it "starts the recovery only after the task, cleanup included, has ended" $ do
    entries <- newLog
    condition <- newTestCondition False
    entered <- newGate
    cleaning <- newGate
    release <- newGate
    let task = do
          again <- (/= []) <$> notes entries
          unless again $ do
            note entries "task"
            (open entered >> hang) `onException` do
              open cleaning
              pass release
              note entries "task is over"
        recovery = note entries "recovery" >> set condition (Value False)
    withThread (Signal.monitor (watched condition) recovery task) $ \caller -> do
      pass entered
      set condition (Value True)
      pass cleaning
      stillRunning caller
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes entries `shouldReturn` ["task", "task is over", "recovery"]

  it "runs the recovery to completion, whatever the condition's state meanwhile" $ do
    entries <- newLog
    condition <- newTestCondition True
    entered <- newGate
    release <- newGate
    let recovery =
          (open entered >> pass release >> note entries "recovered")
            `onException` note entries "interrupted"
        task = note entries "task"
    withThread (Signal.monitor (watched condition) recovery task) $ \caller -> do
      pass entered
      for_ [Value False, Value True, SensorFailure, SensorFault, NoValue, Value False] $ \newState -> do
        set condition newState
        stillRunning caller
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes entries `shouldReturn` ["recovered", "task"]

  for_ [SensorFailure, SensorFault, NoValue] $ \newState ->
    it ("starts nothing when the condition's state after the recovery is " ++ show newState) $ do
      entries <- newLog
      condition <- newTestCondition True
      let recovery = note entries "recovery" >> set condition newState
      end <- ending (Signal.monitor (watched condition) recovery (note entries "task"))
      end `shouldBe` case newState of
        SensorFailure -> FailedWith "FailedBecause \"the sensor\""
        SensorFault -> FaultedWith (show (Fault "the sensor"))
        _ -> FailedWith "FailedBecause \"the signal has no value any more\""
      notes entries `shouldReturn` ["recovery"]

  it "never runs task and recovery at the same time, however often it recovers" $ do
    occupancy <- newOccupancyCounter
    condition <- newTVarIO False
    works <- newTVarIO False
    over <- newGate
    let task =
          inside occupancy $
            (atomically (writeTVar works True) >> pass over)
              `onException` (replicateM_ 3 yield >> atomically (writeTVar works False))
        recovery = inside occupancy (replicateM_ 3 yield >> atomically (writeTVar condition False))
    withThread (Signal.monitor (watchedVar condition) recovery task) $ \caller -> do
      for_ [1 .. 500 :: Int] $ \n -> do
        atomically (writeTVar condition True)
        -- Two times of three, wait until the task runs.
        unless (n `mod` 3 == 0) . atomically $
          (&&) <$> readTVar works <*> (not <$> readTVar condition) >>= check
      open over
      awaitEnd caller `shouldReturn` Gave ()
    mostInside occupancy `shouldReturn` 1

  it "interrupts the recovery of another monitor that is inside its task" $ do
    entries <- newLog
    danger <- newTestCondition False
    low <- newTestCondition True
    entered <- newGate
    let flee = note entries "flee" >> set danger (Value False)
        recharge = do
          again <- (/= []) <$> notes entries
          note entries "recharge"
          unless again ((open entered >> hang) `onException` note entries "unplug")
          set low (Value False)
        task = note entries "task"
        inner = Signal.monitor (watched low) recharge task
    withThread (Signal.monitor (watched danger) flee inner) $ \caller -> do
      pass entered
      set danger (Value True)
      awaitEnd caller `shouldReturn` Gave ()
    notes entries `shouldReturn` ["recharge", "unplug", "flee", "recharge", "task"]

  it "does not let a monitor inside its task interrupt its recovery" $ do
    entries <- newLog
    danger <- newTestCondition False
    low <- newTestCondition False
    let flee = do
          note entries "flee"
          set low (Value True)
          note entries "safe"
          set danger (Value False)
        recharge = note entries "recharge" >> set low (Value False)
        task = do
          again <- (> 1) . length <$> notes entries
          note entries "task"
          unless again (set danger (Value True) >> hang)
    Signal.monitor (watched danger) flee (Signal.monitor (watched low) recharge task)
    notes entries `shouldReturn` ["task", "flee", "safe", "recharge", "task"]

  for_ [minBound .. maxBound] $ \how ->
    it ("is cancelled, and its recovery then " ++ manner how) $ do
      entries <- newLog
      condition <- newTestCondition True
      entered <- newGate
      let recovery = void $ onStop how "recovery" (open entered >> hang)
          act = leavingNothing (Signal.monitor (watched condition) recovery (note entries "task"))
      cancelling act (pass entered) `shouldReturn` case how of
        Faulting -> CancelledWithFault (show (Cancel "the caller")) (show (Fault "recovery"))
        _ -> CancelledBy (show (Cancel "the caller"))
      notes entries `shouldReturn` []

  it "does not recover when it is cancelled while the task stops" $ do
    entries <- newLog
    condition <- newTestCondition False
    entered <- newGate
    cleaning <- newGate
    release <- newGate
    let task =
          (open entered >> hang) `onException` do
            open cleaning
            -- Interruptible; but its stop is not requested a second time.
            pass release
            note entries "task is over"
    withThread (Signal.monitor (watched condition) (note entries "recovery") task) $ \caller -> do
      pass entered
      set condition (Value True)
      pass cleaning
      -- The caller has received it when this returns: it blocks where it can be interrupted.
      throwTo (asyncThreadId caller) (Cancel "the caller")
      open release
      awaitEnd caller `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())
    notes entries `shouldReturn` ["task is over"]
 where
  manner how = case how of
    Cleanly -> "stops"
    Completing -> "nevertheless completes"
    Failing -> "fails"
    Faulting -> "faults: the exception holds both"
