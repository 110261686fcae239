-- |
-- Going on without a behaviour that does not stop: 'abandoning'. Its promises in common with the
-- other operators, which hold while nothing is abandoned, are in the specs that go through "Places".
module Behavior.AbandoningSpec (spec) where

import Control.Concurrent (newEmptyMVar, takeMVar)
import Control.Concurrent.Async (asyncThreadId)
import Control.Concurrent.STM (newTVarIO, writeTVar)
import Control.Exception
import Control.Monad (void)
import Data.Foldable (for_)
import Data.IORef
import Data.List (isInfixOf)
import GHC.Conc (getUncaughtExceptionHandler, setUncaughtExceptionHandler)
import Test.Hspec
import Test.Hspec.QuickCheck (prop)

import Behavior
import Behavior.Internal.Seam.Runtime (liveThreadCount)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Time
import Support
import Watched (watchedVar)

spec :: Spec
spec = guarded . describe "abandoning" $ do
  prop "changes nothing for a behaviour whose stop is not requested" $ \a ->
    sameAs (\entries -> abandoning 0 (play entries a)) (`play` a)

  describe "A behaviour whose stop takes two seconds" $ do
    it "is awaited if it has three; a fault of its stop is not lost" $
      for_ [(pure (), FailedWith "TimedOut 1.0"), (throwIO (Fault "arm"), FaultedWith (show (Fault "arm")))] $
        \(how, expected) -> do
          end <- newIORef Nothing
          run <- simulate $ ending (timeout 1 (abandoning 3 (hang `onException` uninterruptibleMask_ (sleep 2 >> how))))
            >>= writeIORef end . Just
          finished run `shouldBe` 3
          abandonedCount `shouldReturn` 0
          readIORef end `shouldReturn` Just (expected :: Ending ())

    it "is abandoned if it has one; both its abandonment and its end are reported" $ do
      counts <- newIORef []
      let counted = (,) <$> now <*> abandonedCount >>= \c -> modifyIORef' counts (c :)
          slow = hang `onException` uninterruptibleMask_ (sleep 2 >> throwIO (Fault "arm"))
      run <- simulate $ do
        timeout 1 (abandoning 1 slow) ? counted
        sleep 0.5
        counted
        sleep 1
        counted
      readIORef counts `shouldReturn` [(3.5, 0), (2.5, 1), (2, 1)]
      [(stepTime step, text) | step@Step {stepKind = Note text} <- steps run, "abandoning" `isInfixOf` text]
        `shouldBe` [ (2, "abandoning: a behaviour that has not ended 1.0 s after its stop was requested \
                         \is abandoned, and still runs")
                   , (3, "abandoning: a behaviour that was abandoned has ended with " ++ show (Fault "arm"))
                   ]

    it "is never abandoned under any schedule if it ends in time, and always if it does not" $
      for_ [(2.5, 0), (1.5, 1)] $ \(limit, expected) ->
        void . explore (exhaustively 1) $ \simulated -> do
          abandoned <- newIORef (-1)
          _ <- simulated $ do
            timeout 1 (abandoning limit (hang `onException` uninterruptibleMask_ (sleep 2))) ? pure ()
            abandonedCount >>= writeIORef abandoned
            sleep 5
          readIORef abandoned `shouldReturn` expected

    it "is awaited by a thread that does not belong to the trace around it" $ do
      entries <- newLog
      _ <- simulate . watchingThreads (note entries) $ do
        timeout 1 (abandoning 1 (hang `onException` uninterruptibleMask_ (sleep 2))) ? pure ()
        sleep 5
      started <- notes entries
      started `shouldContain` [Started (Label "abandoning" "clock")]
      started `shouldNotContain` [Started (Label "abandoning" "watcher")]

    it "is counted right under any schedule if it ends just as its time is up" $
      void . explore (exhaustively 1) $ \simulated -> do
        counted <- newIORef (-1)
        _ <- simulated $ do
          timeout 1 (abandoning 2 (hang `onException` uninterruptibleMask_ (sleep 2))) ? pure ()
          sleep 1
          abandonedCount >>= writeIORef counted
        readIORef counted `shouldReturn` 0

  it "on real threads: goes on, counts it, and reports by the handler for uncaught exceptions" $ do
    reports <- newLog
    entered <- newGate
    mayEnd <- newGate
    reporting (note reports . show) $ do
      let stuck = uninterruptibleMask_ (open entered >> pass mayEnd >> throwIO (Fault "camera"))
      cancelling (abandoning 0.001 stuck) (pass entered)
        `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())
      abandonedCount `shouldReturn` 1
      eventually ((== 1) . length <$> notes reports)
      open mayEnd
      eventually ((== 0) <$> abandonedCount)
      eventually ((== 2) . length <$> notes reports)
    notes reports
      `shouldReturn` [ "abandoning: a behaviour that has not ended 0.001 s after its stop was requested \
                       \is abandoned, and still runs"
                     , "abandoning: a behaviour that was abandoned has ended with " ++ show (Fault "camera")
                     ]

  for_ [("throws an asynchronous exception", const (throwIO StackOverflow)), ("blocks", pass)] $ \(how, act) ->
    it ("counts right, and reports the end, although the handler " ++ how) $ do
      calls <- newLog
      release <- newGate
      entered <- newGate
      mayEnd <- newGate
      reporting (\_ -> note calls () >> act release) $ do
        _ <- cancelling (abandoning 0.001 (uninterruptibleMask_ (open entered >> pass mayEnd))) (pass entered)
        eventually ((== 1) . length <$> notes calls)
        abandonedCount `shouldReturn` 1
        open mayEnd
        eventually ((== 0) <$> abandonedCount)
        open release
        eventually ((== 2) . length <$> notes calls)

  it "reports the end of a behaviour that is deadlocked" $ do
    calls <- newLog
    entered <- newGate
    reporting (note calls . show) $ do
      _ <- cancelling
        (abandoning 0.001 (uninterruptibleMask_ (open entered >> (newEmptyMVar >>= takeMVar :: IO ()))))
        (pass entered)
      eventually (collecting >> (== 2) . length <$> notes calls)
    last <$> notes calls
      `shouldReturn` "abandoning: a behaviour that was abandoned has ended with " ++ show BlockedIndefinitelyOnMVar

  it "is not interrupted while it waits: a second cancellation stays pending" $ do
    entered <- newGate
    cleaning <- newGate
    mayEnd <- newGate
    entries <- newLog
    let slow = (open entered >> hang)
          `onException` uninterruptibleMask_ (open cleaning >> pass mayEnd >> note entries "ended")
    end <- withThread (abandoning 3600 slow) $ \caller -> do
      pass entered
      throwing (asyncThreadId caller) (Cancel "first")
      pass cleaning
      throwing (asyncThreadId caller) (Cancel "second")
      stillRunning caller
      open mayEnd
      awaitEnd caller
    end `shouldBe` (CancelledBy (show (Cancel "first")) :: Ending ())
    notes entries `shouldReturn` ["ended"]

  it "refuses a negative number and NaN, and starts nothing" $ do
    entries <- newLog
    for_ [-1, 0 / 0] $ \seconds ->
      ending (abandoning seconds (note entries "ran"))
        `shouldReturn` FaultedWith ("abandoning: a duration is zero or more seconds, not " ++ show seconds)
    notes entries `shouldReturn` []

  describe "A drone whose camera hangs while the wind rises" $ do
    it "lands in time if it abandons the camera; the end of the simulation ends that, too" $ do
      landedAt (abandoning 2) `shouldReturn` Just 11
      abandonedCount `shouldReturn` 0
      _ <- simulate (timeout 1 (abandoning 2 (uninterruptibleMask_ (sleep 1000))) ? pure ())
      abandonedCount `shouldReturn` 0
    it "does not land if it awaits the camera" $
      landedAt id `shouldReturn` Nothing

-- | When the drone has landed, in the first 100 seconds. The wind rises after five.
landedAt :: (Behavior () -> Behavior ()) -> IO (Maybe Seconds)
landedAt filming = do
  landed <- newIORef Nothing
  windy <- newTVarIO False
  let film = uninterruptibleMask_ (sleep 1000)
      land = sleep 4 >> now >>= writeIORef landed . Just
      wind = sleep 5 >> atomically (writeTVar windy True)
  _ <- simulateWith defaultSimOptions {endAt = 100} $
    Signal.insteadWhen (watchedVar windy) land (filming film `both` hang) `both` wind
  readIORef landed

-- | Runs the action with this handler for uncaught exceptions, and waits for the watchers.
reporting :: (SomeException -> IO ()) -> IO () -> IO ()
reporting handler act = do
  threads <- liveThreadCount
  usual <- getUncaughtExceptionHandler
  setUncaughtExceptionHandler handler
  (act >> eventually ((== threads) <$> liveThreadCount)) `finally` setUncaughtExceptionHandler usual
