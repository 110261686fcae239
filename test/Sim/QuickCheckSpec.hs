-- |
-- Simulation as a property of QuickCheck.
module Sim.QuickCheckSpec (spec) where

import Control.Concurrent.STM (newTVarIO, readTVar, readTVarIO, writeTVar)
import Test.Hspec hiding (parallel)
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck

import Behavior
import Behavior.Sim
import Behavior.Sim.QuickCheck
import Behavior.Time (atomically)
import Support

spec :: Spec
spec = guarded . describe "A property under schedules" $ do
  prop "holds, whatever is generated" $
    forAll durations $ \(s, t) -> underSchedules $ \simulating -> do
      run <- simulating (both (sleep s) (sleep t))
      pure (finished run === max s t)
  it "does not hold if it does not under one of them" $ do
    result <- quickCheckWithResult quiet counting
    output result `shouldContain` "shrunk to one switch"
    output result `shouldContain` "to see it again: explore (replaying (Switching [("
  it "may throw instead" $ do
    result <- quickCheckWithResult quiet . underSchedules $ \simulating -> do
      _ <- simulating (sleep 1)
      expectationFailure "this is not to be" :: IO ()
    output result `shouldContain` "this is not to be"
  it "is the same for the same seed of QuickCheck" $ do
    first <- quickCheckWithResult quiet counting
    second <- quickCheckWithResult quiet {replay = Just (usedSeed first, usedSize first)} counting
    drop 1 (lines (output second)) `shouldBe` drop 1 (lines (output first))
  it "tries as many schedules as it is told for each test" $ do
    result <- quickCheckWithResult quiet {maxSuccess = 1} . underSchedulesOf 500 $ \simulating -> count simulating
    isSuccess result `shouldBe` False
 where
  quiet = stdArgs {chatty = False, maxSuccess = 500}
  counting = underSchedules count
  -- Two count to two, and forget each other.
  count simulating = do
    counter <- newTVarIO (0 :: Int)
    let step = atomically (readTVar counter) >>= \n -> atomically (writeTVar counter (n + 1))
    _ <- simulating (both step step)
    (=== 2) <$> readTVarIO counter
