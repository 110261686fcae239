-- |
-- 'withTSem': a unit is held while the behaviour runs, and given back whatever happens.
module Behavior.SemaphoreSpec
  ( spec
  , noted
  , isFree
  ) where

import Control.Concurrent (yield)
import Control.Concurrent.Async (asyncThreadId)
import Control.Exception
import Control.Monad (replicateM_, void, when)
import Data.Foldable (for_)
import Test.Hspec
import Test.Hspec.QuickCheck (prop)

import Behavior
import Behavior.STM
import Behavior.Time (timeout)
import Support

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

  it "gives the unit back after the cleanup of the behaviour" $ do
    semaphore <- atomically (newTSem 1)
    wasFree <- newLog
    isHeld <- newGate
    let noteFree = isFree semaphore >>= note wasFree
    timeout 0 (withTSem semaphore hang) ? pure ()
    withTSem semaphore ((open isHeld >> hang) `uninterruptibly` noteFree) ||| pass isHeld
    noteFree
    notes wasFree `shouldReturn` [False, True]

  describe "With a limit on the waiting alone no unit is lost to a cancellation as it is given," $
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

-- | Takes a unit if there is one.
isFree :: TSem -> IO Bool
isFree semaphore = atomically ((True <$ waitTSem semaphore) `orElse` pure False)
