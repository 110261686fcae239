-- |
-- 'Signal.watching', signals made of several, and 'Signal.withShared'. Polled signals and
-- filters have specs of their own.
module Behavior.SignalSpec (spec) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (unless, void)
import Data.Foldable (for_)
import Test.Hspec hiding (after, before)
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck (ioProperty, (===))

import Behavior (Failed (..), both, failed, (?), (|||))
import Behavior.Internal.Seam.Runtime (Label (..), atomically)
import qualified Behavior.Signal as Signal
import Behavior.Sim (Outcome (Returned), Run (outcome), explain, explore, randomly)
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "watching" watchingIt
  describe "A signal made of several" several
  describe "withShared" sharing

watchingIt :: Spec
watchingIt = do
  it "waits for a first value, and later fails when there is none" $ do
    condition <- newTVarIO NoValue
    entered <- newGate
    withThread (Signal.rSelect (watched condition) (open entered >> hang) hang) $ \caller -> do
      stillRunning caller
      set condition (Value True)
      pass entered
      set condition NoValue
      awaitEnd caller `shouldReturn` lost

  it "is not affected when one transaction removes and restores the value" $ do
    condition <- newTestCondition True
    entered <- newGate
    let branch = open entered >> atomically (readTVar condition >>= check . (== Value False)) >> hang
        -- No other transaction can read in between.
        flicker = atomically (writeTVar condition NoValue >> writeTVar condition (Value True))
    withThread (Signal.rSelect (watched condition) branch (pure "right")) $ \caller -> do
      pass entered
      flicker
      stillRunning caller
      set condition (Value False)
      awaitEnd caller `shouldReturn` Gave "right"
 where
  lost = FailedWith "FailedBecause \"the signal has no value any more\"" :: Ending ()

several :: Spec
several = do
  prop "pure ones is the function applied to their values" $ \f x y ->
    let g = if f then (+) else (-) :: Int -> Int -> Int
        constant = pure :: Int -> Signal.Signal Int
     in ioProperty $ (=== g x y) <$> Signal.read (g <$> constant x <*> constant y)

  it "has a value when each has one" $ do
    first <- newTVarIO Nothing
    second <- newTVarIO Nothing
    let given variable = Signal.watching (readTVar variable >>= maybe retry pure)
    withThread (Signal.read ((,) <$> given first <*> given second)) $ \caller -> do
      stillRunning caller
      atomically (writeTVar first (Just 'a'))
      stillRunning caller
      atomically (writeTVar second (Just 'b'))
      awaitEnd caller `shouldReturn` Gave ('a', 'b')

  it "changes once when one transaction changes several" $ do
    entries <- newLog
    first <- newTVarIO (0 :: Int)
    second <- newTVarIO (0 :: Int)
    let branch key = do
          note entries key
          unless (fst key == 50) $ do
            atomically (modifyTVar' first (+ 1) >> modifyTVar' second (+ 1))
            hang
    Signal.switch ((,) <$> watchedVar first <*> watchedVar second) branch
    notes entries `shouldReturn` [(n, n) | n <- [0 .. 50]]

  it "polls a sensor in a thread for each of its occurrences" $ do
    level <- newSensor pure
    let summed a b c = a + b + c
    polled <- started (Signal.waitUntil ((> 6) <$> (summed <$> sensing level <*> sensing level <*> sensing level)))
    polled `shouldBe` replicate 3 (Label "waitUntil" "polling")

  it "can differ from itself, when it is not shared" $ do
    -- Each reading has another number; so two threads' readings are never equal.
    level <- newSensor pure
    Signal.waitUntil ((/=) <$> sensing level <*> sensing level)

-- | The labels of the threads that an action starts.
started :: IO a -> IO [Label]
started act = do
  events <- newLog
  _ <- watchingThreads (note events) act
  notes events >>= \known -> pure [label | Started label <- known]

sharing :: Spec
sharing = do
  prop "withShared s b is b s" $ \c l r ->
    let body n s = Signal.rSelect s (play n l) (play n r)
     in (Signal.withShared (pure c) . body) `sameAs` (\n -> body n (pure c))

  it "polls a sensor in one thread for all occurrences, which are always equal" $ do
    level <- newSensor pure
    labels <- started . Signal.withShared (sensing level) $ \s ->
      Signal.whileHolding ((==) <$> s <*> s) (readingsBeyond 50 level)
    filter ((== "polling") . labelBranch) labels `shouldBe` [Label "withShared" "polling"]

  it "polls a sensor in one thread for several operators at once" $ do
    level <- newSensor (pure . (> 10))
    labels <- started . Signal.withShared (sensing level) $ \s ->
      both (Signal.waitUntil s) (Signal.waitUntil s)
    filter ((== "polling") . labelBranch) labels `shouldBe` [Label "withShared" "polling"]

  it "continues reading while an operator inside recovers" $ do
    level <- newSensor pure
    recovered <- newTVarIO False
    Signal.withShared (sensing level) $ \s ->
      Signal.monitor
        ((\n isRecovered -> n > 0 && not isRecovered) <$> s <*> watchedVar recovered)
        (readingsBeyond 10 level >> atomically (writeTVar recovered True))
        (pure ())

  it "fails each operator that watches a sensor which fails, and nothing else" $ do
    let attempted s = (Signal.waitUntil s >> pure "held") ? pure "failed"
    Signal.withShared (Signal.polling 0.001 (throwIO (Failure "no echo"))) (\s -> (,) <$> attempted s <*> attempted s)
      `shouldReturn` ("failed", "failed")

  it "keeps one memory for all operators inside" $ do
    level <- newTVarIO (95 :: Int)
    Signal.withShared (Signal.hysteresis False 10 90 (watchedVar level)) $ \s -> do
      Signal.waitUntil s
      atomically (writeTVar level 50)
      Signal.rSelect s (pure "left") (pure "right") `shouldReturn` "left"

  for_ [("unmasked", id), ("masked", mask_), ("uninterruptible", uninterruptibleMask_)] $
    \(state, masked) ->
      it ("runs the body unmasked for a caller that is " ++ state) $
        masked (Signal.withShared (pure ()) (const getMaskingState)) `shouldReturn` Unmasked

  for_ [minBound .. maxBound] $ \how ->
    it ("stops its sensors when the body ends, also one that is " ++ show how ++ " when stopped") $ do
      entered <- newGate
      level <- newSensor $ \_ -> onStop how "reading" (open entered >> hang)
      end <- ending (Signal.withShared (sensing level) (\_ -> pass entered >> pure "body"))
      end `shouldBe` case how of
        Faulting -> FaultedWith (show (Fault "reading"))
        _ -> Gave "body"

  for_ [minBound .. maxBound] $ \how ->
    it ("is cancelled with its body and sensors, when the body is " ++ show how ++ " when stopped") $ do
      entered <- newGate
      level <- newSensor (const hang)
      let act = Signal.withShared (sensing level) $ \s ->
            onStop how "body" (open entered >> Signal.waitUntil s >> hang)
      end <- cancelling (leavingNothing act) (pass entered)
      end `shouldBe` case how of
        Faulting -> CancelledWithFault (show (Cancel "the caller")) (show (Fault "body"))
        _ -> CancelledBy (show (Cancel "the caller"))

  it "throws the body's fault rather than a sensor's" $ do
    entered <- newGate
    level <- newSensor $ \_ -> onStop Faulting "reading" (open entered >> hang)
    ending (Signal.withShared (sensing level) (\_ -> pass entered >> throwIO (Fault "body")))
      `shouldReturn` (FaultedWith (show (Fault "body")) :: Ending ())

  it "is closed when the body has ended: to use it then is a fault, and starts nothing" $ do
    entries <- newLog
    leaked <- Signal.withShared (pure True) pure
    ending (Signal.rSelect leaked (note entries "left") (note entries "right")) `shouldReturn` closed
    notes entries `shouldReturn` []

  it "is closed also when its body has failed" $ do
    leaked <- newEmptyTMVarIO
    ending (Signal.withShared (pure True) (\s -> atomically (putTMVar leaked s) >> failed))
      `shouldReturn` (FailedWith (show Failed) :: Ending ())
    atomically (takeTMVar leaked) >>= ending . Signal.waitUntil >>= (`shouldBe` closed)

  it "is closed also if it is stopped before its sensors have started" $
    void . explore (randomly 300) $ \simulated -> do
      leaked <- newEmptyTMVarIO
      run <- simulated $ do
        Signal.withShared (Signal.polling 1 (pure True)) (\s -> atomically (putTMVar leaked s) >> hang)
          ||| void (atomically (readTMVar leaked))
        atomically (takeTMVar leaked) >>= ending . Signal.waitUntil
      explain (outcome run) `shouldBe` explain (Returned (closed :: Ending ()))

  it "fails where its sensor has failed with what is no reading's" $
    ending (Signal.withShared (Signal.olderThan 1 (pure (0 / 0))) Signal.waitUntil)
      `shouldReturn` FaultedWith "olderThan: a point in time is a number, not NaN"

  it "closes also for an operator that still watches it from outside" $ do
    leaked <- newEmptyTMVarIO
    watching <- newGate
    over <- newGate
    let body s = atomically (putTMVar leaked s) >> pass watching
        outside = do
          s <- atomically (takeTMVar leaked)
          Signal.rSelect s (open watching >> hang) (pure ()) `onException` open over
    withThread outside $ \caller -> do
      Signal.withShared (pure True) body
      awaitEnd caller `shouldReturn` closed
    opened over `shouldReturn` True

  it "refuses a bad signal before it starts the body" $ do
    entries <- newLog
    ending (Signal.withShared (Signal.polling 0 (pure ())) (\_ -> note entries "body"))
      `shouldReturn` FaultedWith "polling: a period is at least 0.000001 seconds, not 0.0"
    notes entries `shouldReturn` []
 where
  closed = FaultedWith "withShared: the shared signal was used outside its behaviour" :: Ending ()
