-- |
-- Simulation as a property of QuickCheck.
module Sim.QuickCheckSpec (spec) where

import Control.Concurrent.STM (newTVarIO, readTVar, readTVarIO, writeTVar)
import Control.Exception (fromException, throwIO)
import Control.Monad (unless)
import Data.IORef
import Test.Hspec hiding (parallel)
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck

import Behavior
import Behavior.STM (atomically)
import Behavior.Sim
import Behavior.Sim.QuickCheck
import Support

spec :: Spec
spec = guarded $ do
  describe "A property under schedules" searches
  describe "QuickCheck's verdict on a property under schedules is kept:" verdicts
  describe "Several schedules for each test" several

searches :: Spec
searches = do
  prop "holds for all generated values" $
    forAll anyDurations $ \(s, t) -> underSchedules $ \simulating -> do
      run <- simulating (both (sleep s) (sleep t))
      pure (finished run === max s t)
  it "does not hold if it fails under one of them" $ do
    result <- quickCheckWithResult thorough counting
    output result `shouldContain` "shrunk to one pre-emption"
    output result `shouldContain` "to see it again: explore (replaying (Preempting [("
    output result `shouldContain` "1 /= 2"
  it "may throw instead of being false" $ do
    result <- quickCheckWithResult quiet . underSchedules $ \simulating -> do
      _ <- simulating (sleep 1)
      throwIO (Fault "this is not to be") :: IO ()
    output result `shouldContain` "this is not to be"
    (theException result >>= fromException) `shouldBe` Just (Fault "this is not to be")
  it "simulates only once" $ do
    result <- quickCheckWithResult quiet . underSchedules $ \simulating -> do
      first <- simulating (sleep 1)
      second <- simulating (sleep 1)
      pure (finished first === finished second)
    output result `shouldContain` "a property simulates only once"
  it "is the same for the same seed of QuickCheck" $ do
    let generating = underSchedules $ \simulating -> do
          held <- count simulating
          pure $ \n -> (n :: Int) < 2 .||. held
    first <- quickCheckWithResult thorough generating
    second <- quickCheckWithResult thorough {replay = Just (usedSeed first, usedSize first)} generating
    isSuccess first `shouldBe` False
    drop 1 (lines (output second)) `shouldBe` drop 1 (lines (output first))

verdicts :: Spec
verdicts = do
  it "a property that always discards gives up" $ do
    result <- quickCheckWithResult quiet . underSchedules $ \simulating ->
      simulating (sleep 1) >> pure (False ==> True)
    output result `shouldContain` "Gave up! Passed only 0 tests"
  it "a property that throws a discard gives up" $ do
    result <- quickCheckWithResult quiet . underSchedules $ \simulating ->
      simulating (sleep 1) >> (discard :: IO Bool)
    output result `shouldContain` "Gave up! Passed only 0 tests"
  it "a property that is expected to fail, and never does, fails" $ do
    result <- quickCheckWithResult quiet . underSchedules $ \simulating ->
      simulating (sleep 1) >> pure (expectFailure True)
    output result `shouldContain` "*** Failed! Passed 500 tests (expected failure)"
  it "a property that is expected to fail, and does, holds" $ do
    result <- quickCheckWithResult thorough . underSchedules $ fmap expectFailure . count
    output result `shouldContain` "+++ OK, failed as expected"
  it "a property with insufficient coverage fails" $ do
    result <- quickCheckWithResult quiet . underSchedules $ \simulating -> do
      run <- simulating (sleep 1)
      pure (checkCoverage (cover 50 (finished run > 1) "late" True))
    output result `shouldContain` "Insufficient coverage"
  it "labels and tables are counted" $ do
    result <- quickCheckWithResult quiet . underSchedules $ \simulating -> do
      run <- simulating (sleep 1)
      pure (label "labelled" (tabulate "when" [show (finished run)] True))
    output result `shouldContain` "passed 500 tests (100.0% labelled)"
    output result `shouldContain` "when (500 in total):\n100.0% 1.0"
  it "values that are generated inside are shrunk" $ do
    result <- quickCheckWithResult quiet . underSchedules $ \simulating -> do
      _ <- simulating (sleep 1)
      pure (forAllShrink (choose (0, 1000000)) shrink (\n -> (n :: Int) < 20))
    drop 3 (lines (output result)) `shouldBe` ["to see it again: explore (replaying (Preempting []))", "20"]
  it "values that are generated inside can be simulated, and the shrunk run is reported" $ do
    result <- quickCheckWithResult quiet . underSchedules $ \simulating ->
      pure . forAllShrink (choose (0, 1000)) shrink $ \n -> ioProperty $ do
        run <- simulating (sleep (fromIntegral (n :: Int)))
        pure (finished run < 20)
    drop 2 (lines (output result))
      `shouldBe` [ "     0.000 s  0 main  sleeps until 20.000 s"
                 , "to see it again: explore (replaying (Preempting []))"
                 , "20"
                 ]
  it "nothing is shrunk if maxShrinks is 0" $ do
    result <- quickCheckWithResult thorough {maxShrinks = 0} counting
    numShrinks result `shouldBe` 0
    output result `shouldContain` "under the schedule Seeded"
  it "values that are generated inside grow with the tests" $ do
    sizes <- newIORef []
    quickCheckWith quiet {maxSuccess = 100} . underSchedules $ \simulating -> do
      _ <- simulating (sleep 1)
      pure . forAllBlind getSize $ \size -> ioProperty (True <$ modifyIORef sizes (size :))
    reverse <$> readIORef sizes `shouldReturn` [0 .. 99]

several :: Spec
several = do
  it "are tried" $ do
    result <- quickCheckWithResult quiet {maxSuccess = 1} (underSchedulesOf 2000 count)
    isSuccess result `shouldBe` False
  it "are discarded with the first that is discarded" $ do
    tried <- newIORef (0 :: Int)
    result <- quickCheckWithResult quiet {maxSuccess = 1, maxDiscardRatio = 1} . underSchedulesOf 10 $ \simulating -> do
      _ <- simulating (sleep 1)
      n <- atomicModifyIORef' tried (\n -> (n + 1, n))
      unless (n < 5) discard
    output result `shouldContain` "Gave up!"
    readIORef tried `shouldReturn` 6
  it "are counted as one test" $ do
    result <- quickCheckWithResult quiet {maxSuccess = 100} . underSchedulesOf 10 $ \simulating -> do
      run <- simulating (sleep 1)
      pure (tabulate "when" [show (finished run)] True)
    output result `shouldContain` "when (100 in total)"
  it "are at least one" $ do
    result <- quickCheckWithResult quiet (underSchedulesOf 0 count)
    output result `shouldContain` "underSchedulesOf: at least 1 schedule for each test, and not 0"

quiet :: Args
quiet = stdArgs {chatty = False, maxSuccess = 500}

-- | About one schedule in sixty makes 'count' fail.
thorough :: Args
thorough = quiet {maxSuccess = 2000}

counting :: Property
counting = underSchedules count

-- | Two branches increment a counter, but read and write it in separate transactions.
count :: (Behavior () -> IO (Run ())) -> IO Property
count simulating = do
  counter <- newTVarIO (0 :: Int)
  let step = atomically (readTVar counter) >>= \n -> atomically (writeTVar counter (n + 1))
  _ <- simulating (both step step)
  (=== 2) <$> readTVarIO counter
