{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Behaviours that wait while a condition holds.
module Behavior.PausingSpec (spec) where

import Control.Concurrent.STM (newTVarIO, readTVarIO, writeTVar)
import Control.Exception
import Control.Monad (void)
import Data.Foldable (for_)
import Data.IORef
import Test.Hspec
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck (NonNegative (..), Positive (..), ioProperty, (===))

import Behavior
import Behavior.STM (atomically)
import Behavior.Signal (Signal, pausedWhile, stoppedWhile, teleoReactive)
import Behavior.Sim (Plan, exhaustively, explain, explore, outcome, randomly, simulate)
import Behavior.Time (checkpoint, now, sleepForever, sleepUntil, timeout)
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "pausedWhile" pauses
  describe "stoppedWhile" stops

pauses :: Spec
pauses = do
  it "pauses and resumes whenever the condition changes, and does not stop the behaviour" $ do
    told <- story [(2.5, True), (5, False), (6.5, True), (7, False)] $ \condition record ->
      pausedWhile condition (record "pause") (record "resume") (for_ ["a", "b", "c"] (\leg -> record leg >> sleep 3))
    told
      `shouldBe` [ ("a", 0)
                 , ("pause", 2.5)
                 , ("b", 3)
                 , ("resume", 5)
                 , ("c", 6)
                 , ("pause", 6.5)
                 , ("resume", 7)
                 , ("Gave ()", 9)
                 ]

  it "does not begin while the condition holds, and does not pause what has not begun" $ do
    told <- story [(0, True), (2, False)] $ \condition record ->
      sleep 1 >> pausedWhile condition (record "pause") (record "resume") (record "begin" >> sleep 1)
    told `shouldBe` [("begin", 2), ("Gave ()", 3)]

  it "stops a pause that is no longer needed, and then resumes" $ do
    told <- story [(1, True), (2, False)] $ \condition record ->
      pausedWhile condition (record "pause" >> sleep 9 >> record "paused") (record "resume") (sleep 5)
    told `shouldBe` [("pause", 1), ("resume", 2), ("Gave ()", 5)]

  it "resumes when the behaviour ends while it is paused, and gives its result" $ do
    told <- story [(1, True)] $ \condition record ->
      pausedWhile condition (record "pause") (sleep 1 >> record "resume") (sleep 5)
    told `shouldBe` [("pause", 1), ("resume", 6), ("Gave ()", 6)]

  it "resumes beside the cleanup of the behaviour when it is cancelled" $ do
    told <- story [(1, True)] $ \condition record ->
      let task = sleep 9 `onException` uninterruptibleMask_ (sleep 1 >> record "cleaned up")
       in timeout 2 (pausedWhile condition (record "pause") (record "resume") task) ? pure ()
    told `shouldBe` [("pause", 1), ("resume", 2), ("cleaned up", 3), ("Gave ()", 3)]

  it "stops the behaviour, and throws, when pausing or resuming fails or faults" $
    for_
      [ (failWith "no", failing)
      , (throwIO (Fault "bug"), faulted)
      ]
      $ \(wrong, end) -> do
        let act record = sleep 9 `onException` record "stopped"
        one <- story [(1, True), (2, False)] $ \condition record ->
          pausedWhile condition wrong (record "resume") (act record)
        one `shouldBe` [("resume", 1), ("stopped", 1), (show end, 1)]
        other <- story [(1, True), (2, False)] $ \condition record ->
          pausedWhile condition (record "pause") wrong (act record)
        other `shouldBe` [("pause", 1), ("stopped", 2), (show end, 2)]

  it "ignores a failure of resuming after the end of the behaviour, and throws a fault of it" $
    for_ [(failWith "no", Gave ()), (throwIO (Fault "bug"), faulted)] $
      \(wrong, end) -> do
        told <- story [(1, True)] $ \condition record -> pausedWhile condition (record "pause") wrong (sleep 5)
        told `shouldBe` [("pause", 1), (show end, 5)]

  it "resumes after a pause that swallows the request of its stop, or completes then" $ do
    let slow :: (String -> Behavior ()) -> Behavior ()
        slow record = (record "pause" >> sleep 9) `catch` \(_ :: SomeAsyncException) -> record "swallowed"
    one <- story [(1, True), (2, False)] $ \condition record ->
      pausedWhile condition (slow record) (record "resume") (sleep 5)
    one `shouldBe` [("pause", 1), ("swallowed", 2), ("resume", 2), ("Gave ()", 5)]
    other <- story [(1, True)] $ \condition record ->
      pausedWhile condition (slow record) (record "resume") (sleep 5)
    other `shouldBe` [("pause", 1), ("swallowed", 5), ("resume", 5), ("Gave ()", 5)]

  it "throws what pausing has thrown, whatever resuming throws; a fault in any case" $ do
    let bug = throwIO (Fault "bug")
        ends pause resume changes = do
          told <- story changes $ \condition record ->
            pausedWhile condition pause (record "resume" >> resume) (sleep 5)
          map fst told `shouldContain` ["resume"]
          pure (last told)
    ends bug (failWith "no") [(1, True)] `shouldReturn` (show faulted, 1)
    ends (failWith "no") bug [(1, True)] `shouldReturn` (show faulted, 1)
    ends (failWith "no") (failWith "nor that") [(1, True)] `shouldReturn` (show failing, 1)
    -- In its cleanup: when it is no longer needed, and when the behaviour has ended.
    ends (hang `onException` bug) (failWith "no") [(1, True), (2, False)] `shouldReturn` (show faulted, 2)
    ends (hang `onException` bug) (failWith "no") [(1, True)] `shouldReturn` (show faulted, 5)
    ends (hang `onException` failWith "no") (pure ()) [(1, True), (2, False)] `shouldReturn` (show failing, 2)
    -- While it resumes, it would not be needed any more.
    ends bug (sleep 1) [(1, True), (1.5, False)] `shouldReturn` (show faulted, 2)
    ends (failWith "no") (sleep 1) [(1, True), (1.5, False)] `shouldReturn` (show failing, 2)

  it "resumes to the end: nothing interrupts that" $ do
    let resuming record = record "resume" >> sleep 1 >> record "resumed"
    one <- story [(1, True), (1.5, False)] $ \condition record ->
      pausedWhile condition (failWith "no") (resuming record) (sleep 5)
    one `shouldBe` [("resume", 1), ("resumed", 2), (show failing, 2)]
    other <- story [(1, True), (2, False), (2.25, True)] $ \condition record ->
      timeout 2.5 (pausedWhile condition (record "pause") (resuming record) (sleep 9)) ? pure ()
    other `shouldBe` [("pause", 1), ("resume", 2), ("resumed", 3), ("Gave ()", 3)]

  it "gives the result of a behaviour that completes although the condition has died, or pausing has failed" $ do
    let completing = ('a' <$ sleep 9) `catch` \(_ :: SomeAsyncException) -> pure 'a'
        dying dead = do
          condition <- newTestCondition False
          ended <- newIORef Nothing
          _ <- simulate $
            both
              (ending (pausedWhile (watched condition) (pure ()) (pure ()) completing) >>= writeIORef ended . Just)
              (sleep 1 >> set condition dead)
          readIORef ended
    dying NoValue `shouldReturn` Just (Gave 'a')
    dying SensorFailure `shouldReturn` Just (Gave 'a')
    dying SensorFault `shouldReturn` Just (FaultedWith (show (Fault "the sensor")))
    told <- story [(1, True)] $ \condition _ -> void (pausedWhile condition (failWith "no") (pure ()) completing)
    told `shouldBe` [("Gave ()", 1)]

  prop "is the behaviour beside stoppedWhile, while what pauses stops when it should" $
    \(changes :: [Positive Int]) (Positive end) (NonNegative pausing) (NonNegative resuming) -> ioProperty $ do
      -- (At different moments: with a tie the schedule decides, and the two have different ones.)
      let times = scanl1 (+) [fromIntegral n | Positive n <- changes]
          seconds base n = base + fromIntegral (n :: Int) / 3
          happens pausingBy = story (zip times (cycle [True, False])) $ \condition record ->
            pausingBy
              condition
              (record "pause" >> sleep (seconds 0.01 pausing) >> record "paused")
              (record "resume" >> sleep (seconds 0.003 resuming) >> record "resumed")
              (sleep (seconds 0.5 end) >> record "end")
      (===)
        <$> happens pausedWhile
        <*> happens (\c pause resume act -> act ||| stoppedWhile (not <$> c) ((pause >> sleepForever) `finally` resume))

  it "stops the behaviour when the condition fails, faults or has no value any more" $
    for_ [SensorFailure, SensorFault, NoValue] $ \dead -> do
      condition <- newTestCondition False
      stopped <- newTVarIO False
      let task = sleep 9 `onException` atomically (writeTVar stopped True)
      run <- simulate (pausedWhile (watched condition) (pure ()) (pure ()) task `both` (sleep 1 >> set condition dead))
      explain (outcome run) `shouldNotContain` "returned"
      readTVarIO stopped `shouldReturn` True

  describe "pauses and resumes in turn, and leaves nothing paused," $ do
    it "under random schedules" $ inTurn (randomly 1000) 4 [True, False, True, False, True]
    it "under random schedules in which it is cancelled as the condition changes" $
      inTurn (randomly 1000) 2 [True, False]
    it "under all schedules of a behaviour that makes the condition true, and ends"
      . void . explore (exhaustively 1) $ \simulated -> do
        near <- newTVarIO False
        paused <- newTVarIO False
        let become = atomically . writeTVar paused
        let nears = atomically (writeTVar near True)
        _ <- simulated (pausedWhile (watchedVar near) (become True >> checkpoint) (become False) nears)
        readTVarIO paused `shouldReturn` False

failing, faulted :: Ending ()
failing = FailedWith "FailedBecause \"no\""
faulted = FaultedWith (show (Fault "bug"))

stops :: Spec
stops = do
  it "stops the behaviour while the condition holds, and begins it again" $ do
    told <- story [(2, True), (5, False)] $ \condition record ->
      stoppedWhile condition ((record "begin" >> sleep 3) `onException` record "stopped")
    told `shouldBe` [("begin", 0), ("stopped", 2), ("begin", 5), ("Gave ()", 8)]

  it "waits at first if the condition holds" $ do
    told <- story [(0, True), (2, False)] $ \condition record -> sleep 1 >> stoppedWhile condition (record "begin")
    told `shouldBe` [("begin", 2), ("Gave ()", 2)]

  it "is teleoReactive with one rule: the same happens under all schedules" $ do
    one <- stories stoppedWhile
    other <- stories (\condition act -> teleoReactive [(not <$> condition, act)])
    one `shouldBe` other
 where
  stories stopping = do
    found <- newIORef []
    _ <- explore (exhaustively 1) $ \simulated -> do
      entries <- newLog
      var <- newTVarIO False
      let changes = for_ [True, False, True, False] (\v -> sleep 1 >> atomically (writeTVar var v))
      let task = (note entries "begin" >> sleep 2) `onException` note entries "stopped"
      run <- simulated (both changes (stopping (watchedVar var) task))
      made <- notes entries
      modifyIORef' found ((explain (outcome run), made) :)
    readIORef found

-- | What happened, and when, in a simulation with a condition that changes at these times, and is
-- false before.
story :: [(Seconds, Bool)] -> (Signal Bool -> (String -> Behavior ()) -> Behavior ()) -> IO [(String, Seconds)]
story changes act = do
  var <- newTVarIO False
  entries <- newLog
  let record what = now >>= \t -> note entries (what, t)
      scripted = for_ changes (\(t, v) -> sleepUntil t >> atomically (writeTVar var v))
  _ <- simulate (scripted `both` (ending (act (watchedVar var) record) >>= record . show))
  notes entries

-- | A driver that is paused and resumed, each in two steps, and a behaviour that ends, or is stopped
-- after the given time: pausing and resuming never overlap, and at the end the driver is not paused.
inTurn :: Plan -> Seconds -> [Bool] -> IO ()
inTurn plan limit changes = void . explore plan $ \simulated -> do
  near <- newTVarIO False
  paused <- newTVarIO False
  counter <- newOccupancyCounter
  let pause = inside counter (atomically (writeTVar paused True) >> sleep 0.5)
      resume = inside counter (sleep 0.25 >> atomically (writeTVar paused False))
      person = for_ changes (\is -> sleep 1 >> atomically (writeTVar near is))
      step = pausedWhile (watchedVar near) pause resume (sleep 2.5)
  _ <- simulated (both person (timeout limit (step >> step) ? pure ()))
  mostInside counter >>= (`shouldSatisfy` (<= 1))
  readTVarIO paused `shouldReturn` False
