{-# LANGUAGE RankNTypes #-}

-- |
-- 'withTSem': a unit is held while the behaviour runs, and given back whatever happens.
module Behavior.SemaphoreSpec (spec) where

import Control.Concurrent (yield)
import Control.Concurrent.Async (asyncThreadId)
import Control.Exception
import Control.Monad (replicateM_, unless, void, when)
import Data.Foldable (for_)
import Data.IORef
import Test.Hspec
import Test.Hspec.QuickCheck (prop)

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.STM
import Behavior.Sim (Plan, exhaustively, explore, randomly)
import Behavior.Time (checkpoint, timeout)
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
    wasFree <- newLog
    isHeld <- newGate
    let noteFree = isFree semaphore >>= note wasFree
    timeout 0 (withTSem semaphore hang) ? pure ()
    withTSem semaphore ((open isHeld >> hang) `uninterruptibly` noteFree) ||| pass isHeld
    noteFree
    notes wasFree `shouldReturn` [False, True]

  describe "With a limit on the waiting alone no unit is lost to a cancellation as it is given," $ do
    it "under all schedules, if the grant is noted" $
      lostUnit noted `shouldReturn` False
    it "but one is, if it is not" $ do
      let notNoted semaphore =
            bracket_ (timeout 5 (atomically (waitTSem semaphore))) (atomically (signalTSem semaphore))
      lostUnit notNoted `shouldReturn` True
    it "on real threads, if the grant is noted" $
      for_ [1 .. 1000 :: Int] $ \n -> do
        semaphore <- atomically (newTSem 0)
        withThread (noted semaphore yield) $ \caller -> do
          replicateM_ (n `mod` 7) yield
          atomically (signalTSem semaphore)
          replicateM_ (n `mod` 5) yield
          throwTo (asyncThreadId caller) (Cancel "the caller")
          void (awaitEnd caller)
        isFree semaphore `shouldReturn` True

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

-- | What the documentation of 'withTSem' proposes for a limit on the waiting.
noted :: TSem -> Behavior a -> Behavior a
noted semaphore act = do
  isHeld <- newTVarIO False
  let obtain = atomically (waitTSem semaphore >> writeTVar isHeld True)
      giveBack = atomically (readTVar isHeld >>= \is -> when is (signalTSem semaphore))
  (timeout 5 obtain >> act) `finally` giveBack

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

-- | Takes a unit if there is one.
isFree :: TSem -> IO Bool
isFree semaphore = atomically ((True <$ waitTSem semaphore) `orElse` pure False)

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
