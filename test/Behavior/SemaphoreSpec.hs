{-# LANGUAGE RankNTypes #-}

-- |
-- 'withTSem': a unit is held while the behaviour runs, and given back whatever happens.
module Behavior.SemaphoreSpec (spec) where

import Control.Concurrent.Async (asyncThreadId)
import Control.Exception
import Control.Monad (replicateM_, void)
import Data.Foldable (for_)
import Data.IORef
import Test.Hspec
import Test.Hspec.QuickCheck (prop)

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.STM
import Behavior.Sim (Plan, exhaustively, explore, randomly)
import Behavior.Time (timeout)
import Support
import Watched

spec :: Spec
spec = guarded $ do
  prop "with a unit that is free, changes nothing for the behaviour" $ \script ->
    sameAs (\entries -> atomically (newTSem 1) >>= \semaphore -> withTSem semaphore (play entries script))
      (`play` script)

  it "runs the behaviour in the caller's masking state" $
    for_ [id, mask_, uninterruptibleMask_] $ \inState -> do
      semaphore <- atomically (newTSem 1)
      (there, here) <- inState ((,) <$> withTSem semaphore getMaskingState <*> getMaskingState)
      there `shouldBe` here

  describe "never gives more units than there are, and gets all of them back," $ do
    it "under all schedules without a pre-emption" $ held (exhaustively 0) 1 (drop 1)
    it "under random schedules" $ held (randomly 1000) 2 id

  it "gives the unit back after the cleanup of the behaviour" $ do
    semaphore <- atomically (newTSem 1)
    entries <- newLog
    both
      ( timeout 0 (withTSem semaphore hang)
          ? timeout 0.001 (withTSem semaphore (hang `uninterruptibly` note entries 'a'))
          ? pure ()
      )
      (pure ())
    withTSem semaphore (note entries 'b')
    notes entries `shouldReturn` "ab"

  it "can be stopped while it waits, also where its caller is masked; then it has taken nothing" $ do
    semaphore <- atomically (newTSem 0)
    for_ [id, mask_] $ \inState -> do
      end <- withThread (inState (withTSem semaphore (pure ()))) $ \caller -> do
        awaitIdle (asyncThreadId caller)
        throwing (asyncThreadId caller) (Cancel "the caller")
        awaitEnd caller
      end `shouldBe` CancelledBy (show (Cancel "the caller"))
    atomically (signalTSem semaphore)
    withTSem semaphore (pure 'a') `shouldReturn` 'a'

-- | Behaviours share units. One fails; one is stopped, wherever it is; one is slow to stop.
held :: Plan -> Int -> (forall a. [a] -> [a]) -> IO ()
held plan units some = void . explore plan $ \simulate' -> do
  semaphore <- atomically (newTSem (toInteger units))
  free <- newIORef False
  counter <- newOccupancyCounter
  let using act = withTSem semaphore (inside counter act)
      robots =
        [ (using (sleep 1 >> failed) ? using (sleep 1)) >> hang
        , (using (sleep 1) ||| sleep 1) >> hang
        , using (sleep 3) `onException` uninterruptibleMask_ (sleep 1)
        ]
  _ <- simulate' $ do
    firstOf (some robots) ||| sleep 2
    replicateM_ units (atomically (waitTSem semaphore))
    writeIORef free True
  readIORef free `shouldReturn` True
  mostInside counter >>= (`shouldSatisfy` (<= units))
