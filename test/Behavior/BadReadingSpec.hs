{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Readings of a polled sensor that fail, hang, cannot be interrupted, or throw when they
-- are interrupted; and 'Signal.staleAfter'.
module Behavior.BadReadingSpec (spec) where

import Control.Concurrent.Async (asyncThreadId)
import Control.Concurrent.STM (catchSTM, orElse)
import Control.Exception
import Control.Monad (void, when)
import Data.Foldable (for_)
import Data.IORef (newIORef, readIORef, writeIORef)
import Data.Maybe (isJust)
import Test.Hspec

import Behavior (Failed)
import Behavior.Internal.Concurrent.Scope (Verdict (..), SomeBranch (..), requestStopAsync, outcome, structured)
import Behavior.Internal.Core.Cause (Cause (..))
import Behavior.Internal.Seam.Runtime (atomically, now, sleep)
import Behavior.Internal.Signal.Source (startSensors)
import qualified Behavior.Internal.Signal.Source as Source
import qualified Behavior.Signal as Signal
import Behavior.Sim (simulate)
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "A reading that" goingWrong
  describe "staleAfter" stale

goingWrong :: Spec
goingWrong = do
  for_ operators $ \op ->
    for_ faulty $ \(manner, e) ->
      it (unwords [manner, "ends", show op, "after its branch"]) $ do
        entries <- newLog
        entered <- newGate
        level <- newSensor $ \_ -> opened entered >>= \isEntered -> if isEntered then throwIO e else pure True
        let main =
              (open entered >> hang) `onException` do
                note entries "main is over"
            other = note entries "other" >> pure "other"
        ending (running op (sensing level) main other `onException` note entries "over")
          `shouldReturn` endingOf (Left e)
        notes entries `shouldReturn` ["main is over", "over"]

  for_ faulty $ \(manner, e) ->
    it (manner ++ " as the first one prevents every branch from starting") $ do
      entries <- newLog
      ending (Signal.rSelect (Signal.polling 0.001 (throwIO e)) (note entries "l") (note entries "r"))
        `shouldReturn` endingOf (Left e)
      notes entries `shouldReturn` []

  it "gives an undefined value is not taken for an exception from outside: the fault of another counts" $ do
    entered <- newGate
    level <- newSensor $ \n -> when (n == 2) ((open entered >> hang) `onException` throwIO (Fault "reading"))
    let undefinedValue = Signal.polling 3600 (pass entered >> pure (throw (Fault "value")))
    ending (Signal.rSelect (const <$> undefinedValue <*> sensing level) hang hang)
      `shouldReturn` (FaultedWith (show (Fault "reading")) :: Ending ())

  it "catches its stop request and returns does not prevent the operator from ending" $ do
    entered <- newGate
    level <- newSensor $ \_ -> do
      open entered
      hang `catch` \e -> pure (null (show (e :: SomeAsyncException)))
    cancelling (Signal.waitUntil (sensing level)) (pass entered)
      `shouldReturn` CancelledBy (show (Cancel "the caller"))
    readings level `shouldReturn` 1

  for_ [minBound .. maxBound] $ \how ->
    it (unwords ["is stopped because the branch has completed, and then", manners how]) $ do
      entered <- newGate
      started <- newGate
      level <- newSensor $ \_ -> do
        isStarted <- opened started
        when isStarted . void $ onStop how "reading" (open entered >> hang)
        pure True
      end <- ending (Signal.rSelect (sensing level) (open started >> pass entered) (pure ()))
      end `shouldBe` case how of
        Faulting -> FaultedWith (show (Fault "reading"))
        _ -> Gave ()

  for_ [minBound .. maxBound] $ \how ->
    it (unwords ["is stopped because the caller is cancelled, and then", manners how]) $ do
      entered <- newGate
      level <- newSensor $ \_ -> True <$ onStop how "reading" (open entered >> hang)
      end <- cancelling (leavingNothing (Signal.waitUntil (sensing level))) (pass entered)
      end `shouldBe` case how of
        Faulting -> CancelledWithFault (show (Cancel "the caller")) (show (Fault "reading"))
        _ -> CancelledBy (show (Cancel "the caller"))

  it "cannot be interrupted, and faults when its stop is pending, loses no fault" $ do
    entered <- newGate
    mayEnd <- newGate
    level <- newSensor $ \n ->
      when (n == 2) . uninterruptibleMask_ $ open entered >> pass mayEnd >> throwIO (Fault "reading")
    withThread (Signal.switch (sensing level) (\_ -> pass entered)) $ \caller -> do
      awaitThrown (asyncThreadId caller)
      open mayEnd
      awaitEnd caller `shouldReturn` FaultedWith (show (Fault "reading"))

  it "cannot be interrupted ends before its operator does" $ do
    entries <- newLog
    started <- newGate
    entered <- newGate
    release <- newGate
    level <- newSensor $ \_ -> do
      isStarted <- opened started
      when isStarted . uninterruptibleMask_ $ do
        open entered
        pass release
        note entries "reading is over"
      pure True
    let act = do
          Signal.rSelect (sensing level) (open started >> pass entered >> note entries "branch is over") (pure ())
          note entries "operator is over"
    withThread act $ \caller -> do
      eventually ((== ["branch is over"]) <$> notes entries)
      awaitBlockedByThread (asyncThreadId caller)
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes entries `shouldReturn` ["branch is over", "reading is over", "operator is over"]

  for_ ["reading", "branch"] $ \uninterruptible ->
    it ("is stopped together with the branch: both stop requests are made at once, though the "
        ++ uninterruptible ++ " is uninterruptible") $ do
      started <- newGate
      readingEntered <- newGate
      received <- newGate
      release <- newGate
      let being name entered
            | name == uninterruptible = uninterruptibleMask_ (open entered >> pass release)
            | otherwise = (open entered >> hang) `onException` open received
      level <- newSensor $ \_ -> do
        isStarted <- opened started
        when isStarted (being "reading" readingEntered)
        pure True
      let act = Signal.rSelect (sensing level) (being "branch" started) (pure ())
      withThread act $ \caller -> do
        pass readingEntered
        throwing (asyncThreadId caller) (Cancel "the caller")
        -- The other one receives the stop request while the uninterruptible one still blocks.
        pass received
        open release
        awaitEnd caller `shouldReturn` CancelledBy (show (Cancel "the caller"))
 where
  faulty =
    [ ("fails", toException (Failure "no echo"))
    , ("faults", toException (Fault "no echo"))
    , ("throws a cancellation", toException (Cancel "no echo"))
    ]
  manners how = case how of
    Cleanly -> "stops"
    Completing -> "nevertheless returns"
    Failing -> "fails: the failure is ignored"
    Faulting -> "faults: the fault is thrown"

stale :: Spec
stale = do
  for_ operators $ \op ->
    it ("makes " ++ show op ++ " fail when a reading takes longer, after its branch has ended") $ do
      entries <- newLog
      started <- newGate
      level <- newSensor $ \_ -> opened started >>= \isStarted -> if isStarted then hang else pure True
      let main = (open started >> hang) `onException` note entries "main is over"
          other = note entries "other" >> pure "other"
          signal = Signal.staleAfter 0.005 (sensing level)
      since <- now
      ending (running op signal main other) `shouldReturn` FailedWith (tooLong "0.005")
      over <- now
      over - since `shouldSatisfy` (>= 0.005)
      -- (If the machine took longer than that for a reading which does nothing, no branch
      -- was started.)
      ran <- opened started
      notes entries `shouldReturn` ["main is over" | ran]

  it "fails when there is not even a first reading" $ do
    entries <- newLog
    let signal = Signal.staleAfter 0.001 (Signal.polling 0.001 hang)
    ending (Signal.rSelect signal (note entries "left") (note entries "right"))
      `shouldReturn` FailedWith (tooLong "0.001")
    notes entries `shouldReturn` []

  it "stops the branch in time when the reading cannot be interrupted, and returns after the reading" $ do
    entries <- newLog
    started <- newGate
    stopped <- newGate
    release <- newGate
    level <- newSensor $ \_ -> do
      isStarted <- opened started
      when isStarted . uninterruptibleMask_ $ pass release >> note entries "reading is over"
      pure True
    let branch = (open started >> hang) `onException` (note entries "branch is over" >> open stopped)
        act =
          Signal.rSelect (Signal.staleAfter 0.005 (sensing level)) branch branch
            `onException` (note entries "operator is over" >> open stopped)
    withThread act $ \caller -> do
      pass stopped
      open release
      awaitEnd caller `shouldReturn` (FailedWith (tooLong "0.005") :: Ending ())
    -- (Again, if the machine is too slow no branch was started.)
    ran <- opened started
    notes entries `shouldReturn` ["branch is over" | ran] ++ ["reading is over" | ran] ++ ["operator is over"]

  it "has no effect while readings are in time" $ do
    level <- newSensor (pure . (> 20))
    Signal.waitUntil (Signal.staleAfter 3600 (sensing level))

  -- Tested on the source itself: since when it has a reading in flight.
  it "does not count the time between readings" $ do
    source <- Source.open (Signal.polling (1 / 0) (pure ())) Source.everyValue {Source.readingTimes = True}
    let reading = Source.inFlightSince source
    atomically reading `shouldReturn` Nothing
    structured "test" $ \scope -> do
      (seen, _) <- startSensors scope source
      atomically (Source.firstRead seen)
      atomically reading `shouldReturn` Nothing
      pure (Verdict (SiblingFinished "test") (pure ()))

  it "does not count the time of a recovery for which a reading was stopped" $ do
    entered <- newGate
    level <- newSensor $ \n -> when (n == 1) (open entered >> hang)
    source <- Source.open (sensing level) Source.everyValue {Source.readingTimes = True}
    let reading = Source.inFlightSince source
    structured "test" $ \scope -> do
      (_, workers) <- startSensors scope source
      pass entered
      began <- atomically reading
      began `shouldSatisfy` isJust
      requestStopAsync (SiblingFinished "test") (map SomeBranch workers)
      for_ workers (atomically . outcome)
      _ <- startSensors scope source
      atomically reading >>= (`shouldSatisfy` (/= began))
      pure (Verdict (SiblingFinished "test") (pure ()))

  it "does not count after a recovery a reading that was overdue before it" $ do
    found <- newIORef []
    _ <- simulate $ do
      source <- Source.open (Signal.staleAfter 1 (Signal.polling 1 (hang :: IO ()))) Source.everyValue
      let isStale seen = ((False <$ Source.firstRead seen) `orElse` pure False) `catchSTM` \(_ :: Failed) -> pure True
      structured "test" $ \scope -> do
        (viewBefore, workers) <- startSensors scope source
        sleep 1.5
        requestStopAsync (SiblingFinished "test") (map SomeBranch workers)
        for_ workers (atomically . outcome)
        (viewAfter, _) <- startSensors scope source
        traverse (atomically . isStale) [viewBefore, viewAfter] >>= writeIORef found
        pure (Verdict (SiblingFinished "test") (pure ()))
    readIORef found `shouldReturn` [True, False]

  it "still fails when the reading that was overdue has ended" $ do
    entered <- newGate
    mayEnd <- newGate
    level <- newSensor $ \n -> when (n == 1) (open entered >> pass mayEnd)
    source <- Source.open (Signal.staleAfter 0.001 (sensing level)) Source.everyValue
    structured "test" $ \scope -> do
      (seen, _) <- startSensors scope source
      let isStale view = atomically ((False <$ Source.firstRead view) `catchSTM` \(_ :: Failed) -> pure True)
      pass entered
      isStale seen `shouldReturn` True
      open mayEnd
      -- For a view that is made later, the reading has ended in time.
      eventually $ not <$> (atomically (Source.view source) >>= isStale)
      isStale seen `shouldReturn` True
      pure (Verdict (SiblingFinished "test") (pure ()))

  it "never fails a signal that is not polled" $ do
    condition <- newTestCondition True
    Signal.rSelect (Signal.staleAfter 0.001 (watched condition)) (aWhile 0.001) hang

  it "applies to each of several sources" $ do
    let signal = (&&) <$> Signal.polling 0.001 (pure True) <*> Signal.polling 0.001 hang
    ending (Signal.waitUntil (Signal.staleAfter 0.005 signal))
      `shouldReturn` FailedWith (tooLong "0.005")

  for_ [(0, "0.0"), (-1, "-1.0"), (0 / 0, "NaN")] $ \(limit, shown) ->
    it ("refuses a limit of " ++ shown ++ ", and nothing starts") $ do
      entries <- newLog
      let signal = Signal.staleAfter limit (Signal.polling 0.001 (True <$ note entries "reading"))
      ending (Signal.rSelect signal (note entries "left") (note entries "right"))
        `shouldReturn` FaultedWith ("staleAfter: a period is at least 0.000001 seconds, not " ++ shown)
      notes entries `shouldReturn` []
 where
  tooLong limit = "FailedBecause " ++ show ("no reading of the signal within " ++ limit ++ " s")
