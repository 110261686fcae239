-- |
-- Trying again after a pause, and doing something periodically.
module Behavior.RepeatingSpec (spec) where

import Control.Concurrent (ThreadId, forkIO, killThread, mkWeakThreadId)
import Control.Exception
import Control.Monad (forever, replicateM_, void, when)
import Data.Foldable (for_, traverse_)
import Data.IORef
import Data.Maybe (isJust)
import System.Mem.Weak (Weak, deRefWeak)
import Test.Hspec
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck hiding (Failure)

import Behavior
import Behavior.Sim
  ( SimOptions (..)
  , Outcome (..)
  , Run (outcome)
  , Schedule (Seeded)
  , defaultSimOptions
  , explain
  , simulateWith
  )
import Behavior.Time
import Support

spec :: Spec
spec = guarded $ do
  describe "retrying" retries
  describe "every" periods
  describe "sleepForever" endless

retries :: Spec
retries = do
  prop "with one more delay is a fallback that sleeps first" $ \a ->
    forAll (listOf (pure 0)) $ \delays -> do
      sameAs (\entries -> retrying (0 : delays) (play entries a)) $ \entries ->
        play entries a ? (sleep 0 >> retrying delays (play entries a))

  prop "without delays changes nothing" $ \a ->
    sameAs (\entries -> retrying [] (play entries a)) (`play` a)

  it "pauses as long as the list says, and then throws the last failure" $ do
    (end, starts) <- timed $ \started -> retrying [1, 0.5, 4] (started >>= failWith . show)
    (end, starts) `shouldBe` (FailedWith "FailedBecause \"3\"", [0, 1, 1.5, 5.5])

  it "ends with the first success" $ do
    (end, starts) <- timed $ \started -> retrying (repeat 1) (started >>= \n -> if n < 2 then failed else pure ())
    (end, starts) `shouldBe` (Gave (), [0, 1, 2])

  it "ends at a fault" $ do
    (end, starts) <- timed $ \started -> retrying (repeat 1) (started >> throwIO (Fault "arm"))
    (end, starts) `shouldBe` (FaultedWith (show (Fault "arm")), [0])

  it "can be stopped in a pause" $ do
    (end, starts) <- timed $ \started -> timeout 2.5 (retrying (repeat 2) (started >> failed))
    (end, starts) `shouldBe` (FailedWith "TimedOut 2.5", [0, 2])

  it "refuses a negative delay when it is due" $
    for_ [-1, 0 / 0] $ \delay ->
      ending (retrying [delay] failed)
        `shouldReturn` (FaultedWith ("sleep: a duration is zero or more seconds, not " ++ show delay) :: Ending ())

  it "reports each failure but the last" $ do
    (end, reports) <- observing $ \entries -> do
      n <- newIORef (0 :: Int)
      let act = atomicModifyIORef' n (\k -> (k + 1, k)) >>= failWith . show
      retryingWith (note entries . show) [0, 0] act :: Behavior ()
    (end, reports) `shouldBe` (FailedWith "FailedBecause \"2\"", ["FailedBecause \"0\"", "FailedBecause \"1\""])

  it "reports a failure when it happens" $ do
    (end, times) <- timed $ \called -> retryingWith (\_ -> void called) [1, 2] (called >> failed)
    (end, times) `shouldBe` (FailedWith "Failed", [0, 0, 1, 1, 3])

  it "gives up when the report throws" $ do
    (end, starts) <- timed $ \started ->
      retryingWith
        (\why -> when (show why == "FailedBecause \"1\"") (throwIO why))
        (repeat 1)
        (started >>= failWith . show)
    (end, starts) `shouldBe` (FailedWith "FailedBecause \"1\"", [0, 1])

periods :: Spec
periods = do
  it "starts at once, and then a period apart, however long a run takes" $ do
    (_, starts) <- timed $ \started -> timeout 5.5 (every 1 (started >>= \n -> sleep (if even n then 0.25 else 0.5)))
    starts `shouldBe` [0 .. 5]

  it "does not drift, though timers are late" $ do
    let others = forever (sleep 0.07)
    (_, starts) <- timedWith defaultSimOptions {scheduled = Seeded 1, timerSlip = 0.2} $ \started ->
      timeout 99.5 (every 1 started ||| others)
    length starts `shouldBe` 100
    starts `shouldNotBe` [0 .. 99]
    for_ (zip [0 ..] starts) $ \(slot, start) -> start `shouldSatisfy` \t -> t >= slot && t < slot + 0.2

  it "leaves out the starts that a run has missed" $ do
    (_, starts) <- timed $ \started -> timeout 9.5 (every 1 (started >>= \n -> sleep (if n == 1 then 3.5 else 0.5)))
    starts `shouldBe` [0, 1, 5, 6, 7, 8, 9]

  it "does not leave out a start at which a run ends" $ do
    (_, starts) <- timed $ \started -> timeout 6.5 (every 1 (started >> sleep 2))
    starts `shouldBe` [0, 2, 4, 6]

  it "ends by a failure or a fault, and by nothing else" $ do
    let third stop started = every 1 (started >>= \n -> when (n == 2) stop)
    timed (third failed) `shouldReturn` (FailedWith "Failed", [0, 1, 2])
    timed (third (throwIO (Fault "arm"))) `shouldReturn` (FaultedWith (show (Fault "arm")), [0, 1, 2])

  it "refuses a period of less than a microsecond, and runs nothing" $
    for_ [0, -1, 0 / 0] $ \seconds -> do
      (end, starts) <- timed $ \started -> every seconds started :: Behavior ()
      (end, starts) `shouldBe` (FaultedWith ("every: a period is at least 0.000001 seconds, not " ++ show seconds), [])

endless :: Spec
endless = do
  it "does not end, and can be stopped" $ do
    timed (\started -> timeout 1000000 (started >> sleepForever)) `shouldReturn` (FailedWith "TimedOut 1000000.0", [0])
    cancelling sleepForever (pure ()) `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())

  it "is not taken for a deadlock by GHC" $ do
    let -- (What has a thread's id keeps GHC from taking it for deadlocked.)
        unreachable :: IO () -> IORef (Maybe (Ending ())) -> IO (Weak ThreadId)
        unreachable act end = forkIO (ending act >>= writeIORef end . Just) >>= mkWeakThreadId
    ofHang <- newIORef Nothing
    ofSleep <- newIORef Nothing
    sleeping <- unreachable (sleepForever ||| sleepForever) ofSleep
    _ <- unreachable (hang ||| hang) ofHang
    eventually (collecting >> isJust <$> readIORef ofHang)
    replicateM_ 10 collecting
    readIORef ofHang `shouldReturn` Just (FaultedWith (show BlockedIndefinitelyOnSTM))
    readIORef ofSleep `shouldReturn` Nothing
    deRefWeak sleeping >>= traverse_ killThread
    eventually (isJust <$> readIORef ofSleep)

  it "is a deadlock of a simulation in which nothing else can run, and is named" $ do
    run <- simulateWith defaultSimOptions (sleepForever ||| sleepForever :: Behavior ())
    explain (outcome run) `shouldContain` "parallel: right waits for the end of its sleep"

-- | Simulates a behaviour. It is given an action that records the time, and counts from zero.
timed :: (Behavior Int -> Behavior ()) -> IO (Ending (), [Seconds])
timed = timedWith defaultSimOptions

timedWith :: SimOptions -> (Behavior Int -> Behavior ()) -> IO (Ending (), [Seconds])
timedWith options act = do
  times <- newIORef []
  run <- simulateWith options . act $ do
    t <- now
    atomicModifyIORef' times (\ts -> (t : ts, length ts))
  end <- case outcome run of
    Returned a -> pure (Gave a)
    Threw e -> pure (endingOf (Left e))
    other -> fail (explain other)
  (,) end . reverse <$> readIORef times
