{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- One simulated run.
module Sim.SimulateSpec (spec) where

import Control.Concurrent
import Control.Concurrent.Async (async, cancel, concurrently, race, wait, withAsync)
import Control.Concurrent.STM (modifyTVar', newTVarIO, readTVar, readTVarIO, retry, writeTVar)
import qualified Control.Concurrent.STM as STM
import Control.Exception hiding (Deadlock)
import Control.Monad (forM_, forever, replicateM, unless, void)
import Data.IORef
import Data.List (isInfixOf, nub)
import GHC.Conc (unsafeIOToSTM)
import System.Mem (performMajorGC)
import qualified System.Timeout as System
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Internal.Core.Counter (simulations, total)
import Behavior.Internal.Core.Failure (isCancellation, isFailure)
import Behavior.Internal.Seam.Runtime (annotate)
import Behavior.Parallel (fork, scoped)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Time (checkpoint, now, timeout)
import Sim.Busy (busy)
import Support

spec :: Spec
spec = guarded $ do
  describe "A simulated run" $ do
    describe "ends" outcomes
    describe "takes virtual time" times
    describe "is the same for the same schedule" deterministic
    describe "raises a cancellation by GHC's rule" delivery
  describe "Reported is" mistakes
  describe "When the run has ended," unwinding
  describe "Concurrently with other runs," beside

-- | How a run ended, in words.
ended :: Show a => Run a -> String
ended run = case outcome run of
  Returned a -> "returned " ++ show a
  Threw e
    | isFailure e -> "failed " ++ show e
    | isCancellation e -> "cancelled " ++ show e
    | otherwise -> "faulted " ++ show e
  other -> explain other

outcomes :: Spec
outcomes = do
  it "with the value" $ ended <$> simulate (pure 'a') `shouldReturn` "returned 'a'"
  it "with the failure" $
    ended <$> simulate (failWith "locked" :: Behavior ()) `shouldReturn` "failed FailedBecause \"locked\""
  it "with the fault" $
    ended <$> simulate (throwIO (Fault "bug") :: Behavior ()) `shouldReturn` "faulted Fault \"bug\""
  it "with a cancellation that the behaviour threw itself" $
    ended <$> simulate (throwIO (Cancel "user") :: Behavior ()) `shouldReturn` "cancelled Cancel \"user\""

times :: Spec
times = do
  it "from 0, independent of real time" $ do
    run <- simulate (now >>= \t -> sleep 86400 >> (,) t <$> now)
    ended run `shouldBe` "returned (0.0,86400.0)"
    finished run `shouldBe` 86400
  it "which is that of the longest concurrent branch" $
    finished <$> simulate (both (sleep 3) (sleep 2 >> sleep 2)) `shouldReturn` 4
  it "and none if no branch sleeps" $
    finished <$> simulate (both (pure ()) (atomically (pure ()))) `shouldReturn` 0
  it "and sleepers that are due at the same time wake in any order" $ do
    logged <- newIORef ([] :: [String])
    forM_ [1 .. 40] $ \seed -> do
      order <- newTVarIO []
      let arm name = sleep 1 >> atomically (modifyTVar' order (name :))
      _ <- simulateWith defaultSimOptions {scheduled = Seeded seed} (both (arm 'l') (arm 'r'))
      readTVarIO order >>= \o -> modifyIORef logged (o :)
    orders <- readIORef logged
    nub orders `shouldMatchList` ["lr", "rl"]
  it "up to endAt" $ do
    run <- simulateWith defaultSimOptions {endAt = 10} (forever (sleep 3) :: Behavior ())
    explain (outcome run) `shouldContain` "the end that was set"
    finished run `shouldBe` 10

-- | A small mission with several operators.
mission :: Behavior Int
mission = do
  battery <- newTVarIO (30 :: Int)
  let low = (< 10) <$> Signal.watching (readTVar battery)
      change f = atomically (modifyTVar' battery f)
      work = forM_ [1 .. 5 :: Int] (\_ -> sleep 1 >> change (subtract 7))
  Signal.monitor low (sleep 3 >> change (const 100)) work
    `parallel` monitor (pure False) (pure ()) (sleep 60)
  readTVarIO battery

deterministic :: Spec
deterministic = do
  it "in each step" $
    forM_ [1 .. 50] $ \seed -> do
      let options = defaultSimOptions {scheduled = Seeded seed, detailedSteps = True}
      one <- simulateWith options mission
      other <- simulateWith options mission
      (ended one, steps one, runSchedule one) `shouldBe` (ended other, steps other, runSchedule other)
  it "and the schedule of a run replays it" $
    forM_ [1 .. 50] $ \seed -> do
      one <- simulateWith defaultSimOptions {scheduled = Seeded seed, detailedSteps = True} mission
      other <- simulateWith defaultSimOptions {scheduled = runSchedule one, detailedSteps = True} mission
      (ended one, steps one, runSchedule one) `shouldBe` (ended other, steps other, runSchedule other)
  it "and different for different schedules" $ do
    runs <- mapM (\seed -> simulateWith defaultSimOptions {scheduled = Seeded seed} mission) [1 .. 50]
    length (nub (map (show . runSchedule) runs)) `shouldSatisfy` (> 25)
  it "also during garbage collections" $ do
    -- The runtime system must not detect a deadlock for a thread that waits for its turn.
    run <- simulate (both (forM_ [1 .. 5 :: Int] (\_ -> performMajorGC >> sleep 1)) (sleep 3 >> sleep 4))
    ended run `shouldBe` "returned ()"

-- | What a branch in a masking state does after another branch has failed.
delivery :: Spec
delivery = do
  it "unmasked: at any operation" $ reached id (sleep 1) `shouldReturn` []
  it "masked: not at an operation that need not block" $
    reached mask_ (atomically (pure ())) `shouldReturn` ["went on"]
  it "masked: at an operation that blocks" $ reached mask_ (atomically retry) `shouldReturn` []
  it "masked: at an operation that sleeps" $ reached mask_ (sleep 1) `shouldReturn` []
  it "masked uninterruptibly: never" $
    reached uninterruptibleMask_ (sleep 1) `shouldReturn` ["went on"]
  it "after the last operation: that keeps its effect" $ do
    logged <- newIORef []
    _ <- simulate (parallel (modifyIORef logged ("went on" :)) (failed :: Behavior ()))
    readIORef logged `shouldReturn` ["went on"]
  it "to a thread that has not begun: before its first step" $ do
    logged <- newIORef []
    -- The second branch runs after the first has failed.
    void . simulateWith defaultSimOptions {scheduled = Preempting [(4, 1), (5, 1), (6, 0)]} $
      parallel (failed :: Behavior ()) (modifyIORef logged ("began" :))
    began <- readIORef logged
    began `shouldSatisfy` (`elem` [[], ["began"]])
 where
  -- The stop is requested at the time 0 at which the operation begins.
  reached masked operation = do
    logged <- newIORef []
    requested <- newTVarIO False
    void . simulate $
      parallel
        ( masked $
            uninterruptibleMask_ (atomically (readTVar requested >>= STM.check))
              >> operation
              >> modifyIORef logged ("went on" :)
        )
        (atomically (writeTVar requested True) >> (failed :: Behavior ()))
        ? pure ()
    readIORef logged

mistakes :: Spec
mistakes = do
  it "a deadlock, and what each thread waits for" $ do
    run <- simulate (both (atomically retry :: Behavior ()) (sleep (1 / 0)))
    lines (explain (outcome run))
      `shouldBe` [ "deadlock: every thread waits, and nothing in the simulation will wake one"
                 , "  main waits for a transaction (its branches: both: left, both: right)"
                 , "  both: left waits for a transaction"
                 , "  both: right waits for the end of its sleep"
                 ]
  it "a livelock" $ do
    run <- simulateWith defaultSimOptions {livelockLimit = 3000} (parallel (forever checkpoint) (forever checkpoint))
    explain (outcome run)
      `shouldBe` "livelock: the virtual time does not advance while these threads run: parallel: left, parallel: right"
  it "a livelock, and which values its operators go round with" $ do
    hot <- newTVarIO False
    let turn = atomically . writeTVar hot
        rules =
          Signal.teleoReactive
            [ (Signal.named "hot" (Signal.watching (readTVar hot)), turn False >> sleep 1)
            , (pure True, turn True >> sleep 1)
            ]
    run <- simulateWith defaultSimOptions {livelockLimit = 3000} (sleep 2 >> rules :: Behavior ())
    case outcome run of
      Livelock _ [circle] -> do
        words circle
          `shouldSatisfy` \said -> take 2 said == ["teleoReactive", "reacted"] && read (said !! 2) > (100 :: Int)
        unwords (drop 3 (words circle)) `shouldBe` "times, to hot True, hot False, and started rule 1, rule 2"
        last (lines (explain (outcome run))) `shouldBe` "  " ++ circle
      _ -> expectationFailure (explain (outcome run))
  it "a livelock after reactions that did not cause it" $ do
    hot <- newTVarIO False
    let once =
          Signal.monitor
            (Signal.named "hot" (Signal.watching (readTVar hot)))
            (atomically (writeTVar hot False))
            (sleep 1)
    run <-
      simulateWith
        defaultSimOptions {livelockLimit = 3000}
        ((sleep 0.5 >> atomically (writeTVar hot True)) `both` once >> forever checkpoint :: Behavior ())
    explain (outcome run) `shouldBe` "livelock: the virtual time does not advance while these threads run: main"
  it "a livelock beside operators that have reacted at that time, and are idle or have ended" $ do
    mode <- newTVarIO (0 :: Int)
    seen <- newTVarIO 0
    let current = Signal.watching (readTVar mode)
        sees = atomically . writeTVar seen
        setTo k = atomically (writeTVar mode k) >> atomically (readTVar seen >>= STM.check . (== k))
        switching = Signal.switch (Signal.named "mode" current) (\k -> sees k >> sleep 1)
        leaving = (Signal.whileHolding ((< 20) <$> current) switching ? pure ()) >> sees 20
    forM_ [(2, switching), (20, leaving)] $ \(n, act) -> do
      run <-
        simulateWith
          defaultSimOptions {livelockLimit = 3000}
          (act `both` (mapM_ setTo [0 .. n] >> forever checkpoint) :: Behavior ())
      explain (outcome run) `shouldSatisfy` \text -> "livelock" `isInfixOf` text && not ("reacted" `isInfixOf` text)
  it "a livelock of one thread" $ do
    run <- simulateWith defaultSimOptions {livelockLimit = 3000} (forever checkpoint :: Behavior ())
    explain (outcome run) `shouldContain` "livelock"
  describe "a thread that blocks outside of the library," $ do
    outside "takeMVar" (newEmptyMVar >>= takeMVar) "use atomically and a TMVar"
    outside "threadDelay" (threadDelay 10000000) "use atomically and a TMVar, sleep"
    outside "retry" (STM.atomically retry) "use Behavior.STM.atomically"
    outside
      "System.Timeout"
      (void (System.timeout 10000000 (newEmptyMVar >>= takeMVar :: IO ())))
      "Behavior.Time.timeout"
    outside "async" (async (threadDelay 10000000) >>= wait) "use Behavior.STM.atomically, parallel, both, fork"
    outside "race" (void (race (threadDelay 10000000) (threadDelay 10000000))) "use "
    outside
      "forkIO"
      (newEmptyMVar >>= \box -> forkIO (threadDelay 10000000 >> putMVar box ()) >> takeMVar box)
      "forkIO and a wait for it"
  it "a cleanup that throws to the thread that waits for its end: both threads are named" $ do
    run <- simulate $ do
      me <- myThreadId
      parallel (sleep 1) (sleep 2 `finally` throwTo me (userError "e-stop"))
    let text = explain (outcome run)
    text `shouldContain` "parallel: right waited outside of the simulation, for another thread to receive an exception"
    text `shouldContain` "\n  main waits for a transaction (its branches: parallel: right)"
  it "a thread that is woken from outside" $ do
    -- The transaction succeeds in its fifth run, when nothing in the simulation can change its
    -- result. (A thread outside of the simulation might be too early for that, or too late.)
    looks <- newIORef (0 :: Int)
    let comesTrue = unsafeIOToSTM (atomicModifyIORef' looks (\n -> (n + 1, n >= 4))) >>= STM.check
    run <- simulate (atomically comesTrue)
    explain (outcome run) `shouldContain` "something outside of the simulation changed what these waited for"
  it "a computation without end" $ do
    run <- simulateWith defaultSimOptions {realTimeLimit = 0.1} (mapM_ (evaluate . length . show) [0 :: Int ..])
    explain (outcome run) `shouldContain` "main ran when the limit of real time was reached"
  it "a loop that never allocates, if it is compiled with -fno-omit-yields" $ do
    run <- simulateWith defaultSimOptions {realTimeLimit = 0.1} (busy 0)
    explain (outcome run) `shouldContain` "main ran when the limit of real time was reached"
  it "a simulation inside of a simulation" $ do
    run <- simulate (finished <$> simulate (pure ()))
    ended run `shouldContain` "simulate: a simulation inside of a simulation"
  describe "a schedule that does not fit" $ do
    let small = both (sleep 1) (sleep 2)
        mismatch preemptions text = do
          run <- simulateWith defaultSimOptions {scheduled = Preempting preemptions} small
          explain (outcome run) `shouldContain` ("the schedule does not fit this behaviour: " ++ text)
    it "because the thread cannot run there" $ mismatch [(3, 7)] "at point 3 thread 7 cannot run; those that can: [1,2]"
    it "because the run is shorter" $ mismatch [(300, 1)] "the run ended before point 300"
    it "because only one thread can run there" $ mismatch [(1, 1)] "the run ended before point 1"
 where
  outside name act advice = it (name ++ ", and what to use instead") $ do
    run <- simulate (parallel act (sleep 1))
    let text = explain (outcome run)
    text `shouldSatisfy` ("waited outside of the simulation" `isInfixOf`)
    text `shouldSatisfy` (advice `isInfixOf`)

unwinding :: Spec
unwinding = do
  it "by a deadlock, every cleanup has run, one at a time" $ do
    logged <- newIORef []
    inside <- newIORef (0 :: Int)
    let cleaned name = do
          modifyIORef inside (+ 1)
          forM_ [1 .. 100 :: Int] (const yield)
          n <- readIORef inside
          unless (n == 1) (modifyIORef logged ("not alone" :))
          modifyIORef inside (subtract 1)
          modifyIORef logged (name :)
        hanging name = (atomically retry :: Behavior ()) `finally` cleaned name
    _ <- simulate (both (hanging "left") (hanging "right") `finally` cleaned "main")
    reverse <$> readIORef logged `shouldReturn` ["right", "left", "main"]
  it "a cleanup's transactions and sleeps have run" $ do
    motor <- newTVarIO True
    _ <- simulate ((atomically retry :: Behavior ()) `finally` (sleep 1 >> atomically (writeTVar motor False)))
    readTVarIO motor `shouldReturn` False
  it "a cleanup that blocks, or starts branches, is unwound, too" $ do
    logged <- newIORef []
    _ <-
      simulate $
        (atomically retry :: Behavior ())
          `finally` ( both (atomically retry :: Behavior ()) (atomically retry :: Behavior ())
                        `finally` modifyIORef logged ("inner" :)
                    )
          `finally` modifyIORef logged ("outer" :)
    reverse <$> readIORef logged `shouldReturn` ["inner", "outer"]
  it "a behaviour that catches every exception does not continue" $ do
    count <- newIORef (0 :: Int)
    let stubborn = forever $ do
          modifyIORef count (+ 1)
          try (atomically retry) >>= \(_ :: Either SomeException ()) -> pure ()
    _ <- try (evaluate =<< simulate (stubborn :: Behavior ())) :: IO (Either SomeException (Run ()))
    counted <- readIORef count
    performMajorGC
    threadDelay 1000
    readIORef count `shouldReturn` counted
  it "at endAt, every cleanup has run" $ do
    logged <- newIORef []
    _ <-
      simulateWith
        defaultSimOptions {endAt = 1}
        (parallel (sleep 5 `finally` modifyIORef logged ("left" :)) (sleep 9 `finally` modifyIORef logged ("right" :)))
    reverse <$> readIORef logged `shouldReturn` ["right", "left"]
  it "by a cancellation of the simulation's caller, every cleanup has run" $ do
    logged <- newIORef []
    begun <- newEmptyMVar
    let going = (putMVar begun () >> forever checkpoint) `finally` modifyIORef logged ("cleaned up" :)
    let endless = simulateWith defaultSimOptions {livelockLimit = maxBound}
    withAsync (endless (parallel going (atomically retry :: Behavior ()))) $ \caller -> do
      takeMVar begun
      cancel caller
    readIORef logged `shouldReturn` ["cleaned up"]
  it "no fork has outlived its scope" $ do
    run <- simulate (scoped (\nursery -> void (fork nursery (sleep 100)) >> sleep 1))
    (finished run, leakedThreads run) `shouldBe` (1, [])

beside :: Spec
beside = do
  it "one that is cancelled is over: its threads are dispatched to it no more" $ do
    runningBefore <- total simulations
    begun <- newGate
    cancelling (void (simulate (open begun >> forever (sleep 1)))) (pass begun)
      `shouldReturn` CancelledBy (show (Cancel "the caller"))
    total simulations `shouldReturn` runningBefore
  it "two simulations at once are independent" $ do
    let once = simulateWith defaultSimOptions {scheduled = Seeded 7, detailedSteps = True} mission
    alone <- once
    (one, other) <- concurrently (replicateM 20 once) (replicateM 20 once)
    forM_ (one ++ other) $ \run -> steps run `shouldBe` steps alone
  it "a real behaviour runs in real time" $ do
    begun <- newEmptyMVar
    stop <- newTVarIO False
    let simulated = do
          putMVar begun ()
          forever (sleep 1 >> readTVarIO stop >>= \over -> if over then failed else pure ())
    withAsync (simulate (simulated :: Behavior ())) $ \caller -> do
      takeMVar begun
      begin <- now
      timeout 10 (both (sleep 0.001) (sleep 0.002))
      end <- now
      atomically (writeTVar stop True)
      run <- wait caller
      ended run `shouldBe` "failed Failed"
      (end - begin) `shouldSatisfy` (>= 0.002)
  it "a note of another run is not in the steps" $ do
    annotate "outside"
    run <- simulate (annotate "inside")
    [text | Note text <- map stepKind (steps run)] `shouldBe` ["inside"]
