-- |
-- Cleanups that take time: 'cleanupWithin'.
module Behavior.CleanupSpec (spec) where

import Control.Concurrent.Async (asyncThreadId)
import Control.Exception
import Control.Monad (replicateM_, unless, void)
import Data.Foldable (for_)
import Data.IORef
import Test.Hspec
import Test.Hspec.QuickCheck (prop)

import Behavior
import Behavior.Internal.Seam.Runtime (Label (..), start, threadEnd, threadId, throwToAll)
import Behavior.STM (atomically)
import Behavior.Sim (Run (finished), exhaustively, explore, simulate)
import Behavior.Time
import Support

spec :: Spec
spec = guarded . describe "cleanupWithin" $ do
  prop "changes nothing for a behaviour that is in time" $ \a ->
    sameAs (\entries -> cleanupWithin 3600 (play entries a)) (\entries -> Just <$> play entries a)

  it "requests the stop when the time is up, and waits for it: the result is Nothing" $ do
    ended <- newIORef (-1)
    run <- simulate $ do
      done <- cleanupWithin 3 (sleep 3600 `onException` (uninterruptibleMask_ (sleep 2) >> now >>= writeIORef ended))
      for_ done (const failed)
    finished run `shouldBe` 5
    readIORef ended `shouldReturn` 5

  it "keeps the result of a behaviour that completes although its stop was requested" $
    cleanupWithin 0.001 (hang `catch` \(SomeAsyncException _) -> pure 'c') `shouldReturn` Just 'c'

  it "throws the behaviour's own failure or fault, also of its stop" $ do
    ending (cleanupWithin 3600 failed) `shouldReturn` (FailedWith "Failed" :: Ending (Maybe ()))
    ending (cleanupWithin 3600 (timeout 0 hang)) `shouldReturn` (FailedWith "TimedOut 0.0" :: Ending (Maybe ()))
    ending (cleanupWithin 0.001 (hang `onException` throwIO (Fault "arm")))
      `shouldReturn` (FaultedWith (show (Fault "arm")) :: Ending (Maybe ()))

  it "runs the behaviour unmasked, whatever the caller's state, and leaves that as it was" $
    for_ [id, mask_, uninterruptibleMask_] $ \inState -> do
      (earlier, inside, later) <-
        inState ((,,) <$> getMaskingState <*> cleanupWithin 3600 getMaskingState <*> getMaskingState)
      inside `shouldBe` Just Unmasked
      later `shouldBe` earlier

  it "does not start the behaviour without time, and refuses a negative one" $ do
    entries <- newLog
    cleanupWithin 0 (note entries "ran") `shouldReturn` Nothing
    for_ [-1, 0 / 0] $ \seconds ->
      ending (cleanupWithin seconds (note entries "ran"))
        `shouldReturn` FaultedWith ("cleanupWithin: a duration is zero or more seconds, not " ++ show seconds)
    notes entries `shouldReturn` []

  describe "As the cleanup of a cancelled behaviour" $ do
    it "runs to its end, however often the caller is cancelled meanwhile; the first cancellation goes on" $ do
      entries <- newLog
      entered <- newGate
      cleaning <- newGate
      mayEnd <- newGate
      let park = open cleaning >> pass mayEnd >> note entries "parked"
      end <- withThread ((open entered >> hang) `onException` cleanupWithin 3600 park) $ \caller -> do
        pass entered
        throwing (asyncThreadId caller) (Cancel "first")
        pass cleaning
        replicateM_ 3 (throwing (asyncThreadId caller) (Cancel "later"))
        stillRunning caller
        open mayEnd
        awaitEnd caller
      notes entries `shouldReturn` ["parked"]
      end `shouldBe` (CancelledBy (show (Cancel "first")) :: Ending ())

    it "when its time is up, the cancellation goes on too, and the operator's outcome stays" $
      ending (timeout 0.001 (hang `onException` cleanupWithin 0.001 hang))
        `shouldReturn` (FailedWith "TimedOut 0.001" :: Ending ())

    it "parks the arm under all schedules in which it is cancelled twice; a plain handler does not" $ do
      notParked (void . cleanupWithin 10) `shouldReturn` 0
      notParked id >>= (`shouldSatisfy` (> 0))

-- | In how many schedules an arm is not parked at the end. The thread that moves it is cancelled,
-- and once more while it parks.
notParked :: (Behavior () -> Behavior ()) -> IO Int
notParked cleanup = do
  count <- newIORef 0
  _ <- explore (exhaustively 1) $ \simulated -> do
    parked <- newIORef False
    let park = sleep 1 >> writeIORef parked True
        cancel thread = throwToAll (const (Cancel "the arm")) [threadId thread]
    _ <- simulated $ do
      arm <- mask_ (start (Label "arm" "") (sleep 3600 `onException` cleanup park))
      sleep 2 >> cancel arm >> sleep 0.5 >> cancel arm
      atomically (threadEnd arm)
    isParked <- readIORef parked
    unless isParked $ modifyIORef' count (+ 1)
  readIORef count
