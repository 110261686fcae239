-- |
-- Late timers.
module Sim.SlipSpec (spec) where

import Control.Concurrent.STM (TVar, modifyTVar', newTVarIO, readTVarIO)
import Control.Monad (forM_, unless)
import Data.Foldable (traverse_)
import Data.IORef
import Data.List (nub, sort)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Parallel (allOf)
import Behavior.STM (atomically)
import Behavior.Sim
import Behavior.Time (now)
import Support (guarded)

spec :: Spec
spec = guarded . describe "Slip" $ do
  it "of 0 gives the same schedules, and every sleeper wakes on time" $
    forM_ [1 .. 200] $ \seed -> do
      exact <- simulateWith defaultSimOptions {scheduled = Seeded seed, detailedSteps = True} sleepers
      again <- simulateWith defaultSimOptions {scheduled = Seeded seed, detailedSteps = True, timerSlip = 0} sleepers
      (steps again, runSchedule again) `shouldBe` (steps exact, runSchedule exact)
      late again `shouldBe` Just [0, 0, 0, 0]
  it "lets a sleeper wake before another that is due less than the slip earlier" $ do
    orders <- ordersWith 0.5 [1, 1.3]
    sort orders `shouldBe` [[1, 1.3], [1.3, 1]]
  it "does not let a sleeper wake before another that is due earlier by the slip or more" $ do
    ordersWith 0.5 [1, 1.5] `shouldReturn` [[1, 1.5]]
    ordersWith 0 [1, 1.3] `shouldReturn` [[1, 1.3]]
  it "makes some sleepers late, each by less than the slip" $ do
    let slipping seed = simulateWith defaultSimOptions {scheduled = Seeded seed, timerSlip = 0.5} sleepers
    lates <- mapM (fmap late . slipping) [1 .. 300]
    forM_ lates $ \l -> l `shouldSatisfy` maybe False (all (\s -> 0 <= s && s < 0.5))
    lates `shouldSatisfy` any (maybe False (any (> 0)))
  it "is part of the schedule of a run" $
    forM_ [1 .. 100] $ \seed -> do
      one <- simulateWith defaultSimOptions {scheduled = Seeded seed, timerSlip = 0.5, detailedSteps = True} sleepers
      let again = defaultSimOptions {scheduled = runSchedule one, timerSlip = 0.5, detailedSteps = True}
      other <- simulateWith again sleepers
      (steps one, runSchedule one, finished one) `shouldBe` (steps other, runSchedule other, finished other)
  it "is explored exhaustively, and does not count as a pre-emption" $ do
    orders <- newIORef []
    report <- explore ((exhaustively 0) {planOptions = defaultSimOptions {timerSlip = 0.5}}) $ \simulated -> do
      order <- newTVarIO []
      _ <- simulated (ordered order [1, 1.3, 1.4])
      readTVarIO order >>= \o -> modifyIORef orders (reverse o :)
    reportComplete report `shouldBe` True
    nub . sort <$> readIORef orders
      `shouldReturn` sort [[1, 1.3, 1.4], [1, 1.4, 1.3], [1.3, 1, 1.4], [1.3, 1.4, 1], [1.4, 1, 1.3], [1.4, 1.3, 1]]
  it "does not move the time beyond endAt" $
    forM_ [1 .. 50] $ \seed -> do
      run <- simulateWith defaultSimOptions {scheduled = Seeded seed, timerSlip = 5, endAt = 2}
        (both (sleep 1) (sleep 4))
      finished run `shouldBe` 2
  it "finds a defect that depends on exact timers" $ do
    found <- tryExplore ((randomly 1000) {planOptions = defaultSimOptions {timerSlip = 0.1}}) $ \simulated -> do
      run <- simulated $ do
        parked <- newTVarIO False
        both
          (sleep 1 >> atomically (modifyTVar' parked (const True)))
          (sleep 1.05 >> readTVarIO parked >>= \is -> unless is failed)
      traverse_ fail [explain (outcome run) | Threw _ <- [outcome run]]
    either (const "found") show found `shouldBe` "found"

-- | Four branches that sleep; returns how late each wakes.
sleepers :: Behavior [Seconds]
sleepers = allOf [lateness (sleepTo s) | s <- [1, 1.2, 1.4, 1.6]]
 where
  sleepTo s = (,) s <$ sleep s <*> now
  lateness act = (\(s, t) -> rounded (t - s)) <$> act
  rounded t = if abs t < 1e-9 then 0 else t

late :: Run [Seconds] -> Maybe [Seconds]
late run = case outcome run of
  Returned l -> Just l
  _ -> Nothing

ordered :: TVar [Seconds] -> [Seconds] -> Behavior [()]
ordered order moments = allOf [sleep s >> atomically (modifyTVar' order (s :)) | s <- moments]

-- | The orders in which sleepers with these durations wake, under many schedules.
ordersWith :: Seconds -> [Seconds] -> IO [[Seconds]]
ordersWith most moments = nub <$> mapM one [1 .. 200]
 where
  one seed = do
    order <- newTVarIO []
    _ <- simulateWith defaultSimOptions {scheduled = Seeded seed, timerSlip = most} (ordered order moments)
    reverse <$> readTVarIO order
