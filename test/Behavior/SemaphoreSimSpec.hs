{-# LANGUAGE RankNTypes #-}

-- |
-- 'withTSem' under explored schedules: units are neither made nor lost.
module Behavior.SemaphoreSimSpec (spec) where

import Control.Exception
import Control.Monad (replicateM_, unless, void)
import Data.IORef
import Test.Hspec

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.STM
import Behavior.SemaphoreSpec (isFree, noted)
import Behavior.Sim (Plan, exhaustively, explore, randomly)
import Behavior.Time (checkpoint, timeout)
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "never gives more units than there are, and gets all of them back," $ do
    it "under all schedules without a pre-emption" $ held (exhaustively 0) 1 (drop 1)
    it "under random schedules" $ held (randomly 1000) 2 id

  describe "With a limit on the waiting alone no unit is lost to a cancellation as it is given," $ do
    it "under all schedules, if the grant is noted" $
      lostUnit noted `shouldReturn` False
    it "but one is, if it is not" $ do
      let notNoted semaphore =
            bracket_ (timeout 5 (atomically (waitTSem semaphore))) (atomically (signalTSem semaphore))
      lostUnit notNoted `shouldReturn` True

-- | Whether, in one of the schedules, a unit is lost that is given at about the moment at which the robot
-- that waits for it is cancelled.
lostUnit :: (TSem -> Behavior () -> Behavior ()) -> IO Bool
lostUnit holding = do
  found <- newIORef False
  _ <- explore (exhaustively 1) $ \simulated -> do
    semaphore <- atomically (newTSem 0)
    _ <- simulated (holding semaphore (sleep 1) ||| (atomically (signalTSem semaphore) >> checkpoint))
    free <- isFree semaphore
    unless free (writeIORef found True)
  readIORef found

-- | Behaviours share units. One fails; one is stopped, wherever it is; one is slow to stop.
held :: Plan -> Int -> (forall a. [a] -> [a]) -> IO ()
held plan units some = void . explore plan $ \simulated -> do
  semaphore <- atomically (newTSem (toInteger units))
  free <- newIORef False
  counter <- newOccupancyCounter
  let using act = withTSem semaphore (inside counter act)
      robots =
        [ (using (sleep 1 >> failed) ? using (sleep 1)) >> hang
        , (using (sleep 1) ||| sleep 1) >> hang
        , using (sleep 3) `onException` uninterruptibleMask_ (sleep 1)
        ]
  _ <- simulated $ do
    firstOf (some robots) ||| sleep 2
    replicateM_ units (atomically (waitTSem semaphore))
    writeIORef free True
  readIORef free `shouldReturn` True
  mostInside counter >>= (`shouldSatisfy` (<= units))
