{-# LANGUAGE CPP #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- The seam, and the scope that all operators are built on.
module Behavior.RuntimeSpec (spec) where

import Control.Concurrent
import Control.Concurrent.Async (asyncThreadId, poll)
import Control.Concurrent.STM (newTVarIO, readTVar, readTVarIO, retry, writeTVar)
import Control.Exception
import Control.Monad (replicateM, void)
import Data.Foldable (for_, traverse_)
import Data.Maybe (isNothing)
import GHC.Conc (unsafeIOToSTM)
#if MIN_VERSION_base(4,18,0)
import GHC.Conc.Sync (threadLabel)
#endif
import Test.Hspec hiding (parallel)

import Behavior (Failed (..), StoppedWithFault (..), both, failed, parallel)
import Behavior.Internal.Concurrent.Outcome (outcomeToIO)
import Behavior.Internal.Concurrent.Scope
import Behavior.Internal.Core.Cause (Cause (..))
import Behavior.Internal.Core.Property (keepMistake, mistakeOf, testing)
import Behavior.Internal.Core.Stop (Stop (..), causeOf)
import Behavior.Internal.Seam.Runtime
import qualified Behavior.Signal as Signal
import Behavior.Sim (Run (finished), explore, randomly)
import Support

spec :: Spec
spec = guarded $ do
  describe "start" starting
  describe "interrupt" interrupting
  describe "A thread" reporting
  describe "atomically" waiting
  describe "A test of a property" mistakes
  describe "structured" scopes
  describe "StoppedWithFault" pairs

label :: Label
label = Label "operator" "branch"

stateOf :: [IO a -> IO a]
stateOf = [id, mask_, uninterruptibleMask_]

starting :: Spec
starting = do
  it "publishes how the thread ended" $ do
    thread <- mask_ (start label (pure 'a'))
    atomically (threadEnd thread) >>= (`shouldBe` Gave 'a') . endingOf
    faulty <- mask_ (start label (throwIO (Fault "bug") :: IO ()))
    atomically (threadEnd faulty) >>= (`shouldBe` FaultedWith (show (Fault "bug"))) . endingOf

  it "runs the action unmasked in a thread of its own, whatever the caller's state" $
    for_ stateOf $ \inState -> do
      caller <- myThreadId
      thread <- inState (mask_ (start label ((,) <$> getMaskingState <*> myThreadId)))
      Right (state, self) <- atomically (threadEnd thread)
      state `shouldBe` Unmasked
      self `shouldBe` threadId thread
      self `shouldNotBe` caller

  it "counts the thread as live until it has ended, and no longer" $ do
    threadsBefore <- liveThreadCount
    gate <- newGate
    thread <- mask_ (start label (pass gate))
    liveThreadCount `shouldReturn` threadsBefore + 1
    open gate
    _ <- atomically (threadEnd thread)
    liveThreadCount `shouldReturn` threadsBefore

  it "no longer counts the thread when it publishes how it ended" $ do
    threadsBefore <- liveThreadCount
    counted <- newTVarIO (-1)
    let count _ = unsafeIOToSTM liveThreadCount >>= writeTVar counted
    thread <- mask_ (startWith Inherited pure count label (pure ()))
    _ <- atomically (threadEnd thread)
    readTVarIO counted `shouldReturn` threadsBefore

  it "publishes how the thread ended by the transaction that is part of that" $ do
    gate <- newGate
    thread <- mask_ (startWith Inherited pure (\_ -> passed gate) label (pure 'a'))
    awaitIdle (threadId thread)
    isNothing <$> tryReadEnd thread `shouldReturn` True
    open gate
    end <- atomically (threadEnd thread)
    endingOf end `shouldBe` Gave 'a'

  it "labels the thread with its operator and branch" $ do
    show (Label "parallel" "left") `shouldBe` "parallel: left"
#if MIN_VERSION_base(4,18,0)
    thread <- mask_ (start label (myThreadId >>= threadLabel))
    Right found <- atomically (threadEnd thread)
    found `shouldBe` Just (show label)
#endif

  it "always publishes how it ended, even if it was killed as soon as it was started" $
    for_ [1 .. 2000 :: Int] $ \_ -> do
      thread <- mask_ (start label hang) :: IO (Thread (Either SomeException ()))
      killThread (threadId thread)
      end <- atomically (threadEnd thread)
      endingOf end `shouldBe` CancelledBy (show ThreadKilled)

interrupting :: Spec
interrupting = do
  it "returns when the thread has received the exception" $ do
    inside <- newGate
    mayEnd <- newGate
    thread <- mask_ (start label (uninterruptibleMask_ (open inside >> pass mayEnd) >> hang :: IO ()))
    pass inside
    withThread (interrupt (threadId thread) (Cancel "thread")) $ \caller -> do
      poll caller >>= (`shouldBe` True) . isNothing
      open mayEnd
      awaitEnd caller `shouldReturn` Gave ()
      end <- atomically (threadEnd thread)
      endingOf end `shouldBe` CancelledBy (show (Cancel "thread"))

  it "has thrown nothing if it is interrupted before the thread has received the exception" $ do
    inside <- newGate
    mayEnd <- newGate
    thread <- mask_ (start label (uninterruptibleMask_ (open inside >> pass mayEnd) >> pure 'a'))
    pass inside
    cancelling (interrupt (threadId thread) (Cancel "thread")) (pure ())
      `shouldReturn` CancelledBy (show (Cancel "the caller"))
    open mayEnd
    end <- atomically (threadEnd thread)
    endingOf end `shouldBe` Gave 'a'

  it "has a variant, throwToAll, that does not wait" $ do
    inside <- newGate
    mayEnd <- newGate
    thread <- mask_ (start label (uninterruptibleMask_ (open inside >> pass mayEnd) >> hang :: IO ()))
    pass inside
    throwToAll (const (Cancel "thread")) [threadId thread]
    open mayEnd
    end <- atomically (threadEnd thread)
    endingOf end `shouldBe` CancelledBy (show (Cancel "thread"))

  it "does nothing to a thread that has ended" $ do
    thread <- mask_ (start label (pure 'a'))
    awaitOver (threadId thread)
    interrupt (threadId thread) (Cancel "thread")
    throwToAll (const (Cancel "thread")) [threadId thread]
    end <- atomically (threadEnd thread)
    endingOf end `shouldBe` Gave 'a'

reporting :: Spec
reporting = do
  it "reports the start and the end of each thread, in the thread itself, masked" $ do
    entries <- newLog
    let sink event = (,,) event <$> myThreadId <*> getMaskingState >>= note entries
    thread <- watchingThreads sink $ do
      thread <- mask_ (start label (pure ()))
      thread <$ atomically (threadEnd thread)
    events <- notes entries
    [(event, reporter) | (event, reporter, _) <- events]
      `shouldBe` [(Started label, threadId thread), (Ended label, threadId thread)]
    [state | (_, _, state) <- events] `shouldSatisfy` notElem Unmasked

  it "reports the end of a thread that throws" $ do
    (_, events) <- observing $ \entries -> watchingThreads (note entries) $ do
      thread <- mask_ (start label (failed :: IO ()))
      atomically (threadEnd thread)
    events `shouldBe` [Started label, Ended label]

  it "reports nothing after the action has ended, in whatever way" $ do
    (end, events) <- observing $ \entries -> do
      watchingThreads (note entries) (pure ())
      _ <- ending (watchingThreads (note entries) failed)
      thread <- mask_ (start label (pure ()))
      void (atomically (threadEnd thread))
    end `shouldBe` Gave ()
    events `shouldBe` []

waiting :: Spec
waiting = do
  it "can be interrupted, also where exceptions are masked" $
    for_ [id, mask_] $ \inState -> do
      withThread (inState (atomically retry)) $ \caller -> do
        awaitIdle (asyncThreadId caller)
        throwTo (asyncThreadId caller) (Cancel "caller")
        awaitEnd caller `shouldReturn` (CancelledBy (show (Cancel "caller")) :: Ending ())

  it "cannot be interrupted inside awaitUninterruptibly" $ do
    var <- newTVarIO False
    withThread (awaitUninterruptibly (atomically (readTVar var >>= \there -> if there then pure 'a' else retry))) $
      \caller -> do
        awaitIdle (asyncThreadId caller)
        throwing (asyncThreadId caller) (Cancel "caller")
        stillRunning caller
        atomically (writeTVar var True)
        awaitOver (asyncThreadId caller)

  it "is repeated inside awaitUninterruptibly each time that GHC takes the thread for deadlocked" $ do
    entries <- newLog
    let deadlocked = hang `catch` \BlockedIndefinitelyOnSTM -> note entries "deadlocked"
    _ <- forkIO $ do
      thread <- mask_ (start label (deadlocked >> deadlocked >> deadlocked))
      void (awaitUninterruptibly (atomically (threadEnd thread)))
      note entries "awaited"
    eventually (collecting >> elem "awaited" <$> notes entries)
    notes entries `shouldReturn` ["deadlocked", "deadlocked", "deadlocked", "awaited"]

  it "has a checkpoint where a cancellation arrives that was masked until then" $ do
    ready <- newGate
    mayGo <- newGate
    (end, done) <- observing $ \entries -> do
      let act = mask $ \restore -> do
            uninterruptibleMask_ (open ready >> pass mayGo)
            note entries "masked"
            restore checkpoint
            note entries "went on"
      withThread act $ \caller -> do
        pass ready
        throwing (asyncThreadId caller) (Cancel "caller")
        open mayGo
        awaitEnd caller
    (end, done) `shouldBe` (Gave (CancelledBy (show (Cancel "caller"))), ["masked"])

mistakes :: Spec
mistakes = do
  it "keeps the first mistake, also when another property was tested within it" $ do
    kept <- testing $ \property -> do
      testing (\_ -> pure ())
      for_ ["first", "second"] $ \mistake -> currentProperty >>= traverse_ (`keepMistake` Fault mistake)
      mistakeOf property
    fmap show kept `shouldBe` Just (show (Fault "first"))

  it "is no property after its end any more" $ do
    for_ [pure (), throwIO (Fault "property")] $ \act -> do
      _ <- ending (testing (const act))
      isNothing <$> currentProperty `shouldReturn` True

scopes :: Spec
scopes = do
  it "runs the verdict when nothing was started" $ do
    inScope (\_ -> pure (pure 'a')) `shouldReturn` 'a'
    inScope (\_ -> pure (failed :: IO ())) `shouldThrow` (== Failed)
    inScope (\_ -> failed :: IO (IO ())) `shouldThrow` (== Failed)

  it "runs the verdict when all branches have ended" $
    for_ [pure (), failed] $ \bodysEnd -> do
      (_, done) <- observing $ \entries -> inScope $ \scope -> do
        inside <- newGate
        _ <- branch scope "branch" ((open inside >> hang) `onException` note entries "cleaned up") :: IO (Branch ())
        pass inside
        pure (note entries "verdict" >> bodysEnd)
      done `shouldBe` ["cleaned up", "verdict"]

  it "stops what was started when the body throws" $ do
    (end, done) <- observing $ \entries -> inScope $ \scope -> do
      inside <- newGate
      _ <- branch scope "branch" ((open inside >> hang) `onException` note entries "cleaned up") :: IO (Branch ())
      pass inside
      throwIO (Fault "body") :: IO (IO ())
    (end, done) `shouldBe` (FaultedWith (show (Fault "body")), ["cleaned up"])

  it "lets a worker read whether its stop was requested" $ do
    (_, values) <- observing $ \entries -> inScope $ \scope -> do
      inside <- newGate
      mayEnd <- newGate
      started <- branchWith plainly scope "branch" $ \stopRequested -> do
        stopRequested >>= note entries
        (open inside >> hang) `catch` \(_ :: SomeAsyncException) -> stopRequested >>= note entries
        pass mayEnd
      pass inside
      requestStopAsync cause [SomeBranch started]
      open mayEnd
      pure <$> atomically (outcome started)
    values `shouldBe` [False, True]

  it "throws the stop request to a branch only once, however often it is made" $ do
    (_, done) <- observing $ \entries -> inScope $ \scope -> do
      inside <- newGate
      cleaning <- newGate
      mayEnd <- newGate
      started <- branch scope "branch" $
        (open inside >> hang)
          `onException` (open cleaning >> pass mayEnd >> note entries "cleaned up") :: IO (Branch ())
      pass inside
      requestStopAsync cause [SomeBranch started]
      requestStopAsync cause [SomeBranch started]
      pass cleaning
      open mayEnd
      pure (pure ())
    done `shouldBe` ["cleaned up"]

  it "has requested the stop, or can do so again, when its caller is interrupted just then" $
    for_ [1 .. 4000 :: Int] $ \n -> inScope $ \scope -> do
      inside <- newGate
      running <- branch scope "branch" (open inside >> hang) :: IO (Branch ())
      pass inside
      caller <- mask_ (start label (requestStop cause [SomeBranch running]))
      -- (With two capabilities the request is at another of its steps each time.)
      _ <- evaluate (sum [1 .. n `mod` 400])
      interrupt (threadId caller) (Cancel "user")
      pure (pure ())

  it "requests the stops of uninterruptible branches without waiting" $ do
    (end, done) <- observing $ \entries -> inScope $ \scope -> do
      insides <- replicateM 3 newGate
      mayEnd <- newGate
      let act inside = uninterruptibleMask_ (open inside >> pass mayEnd) >> hang
      started <- traverse (branch scope "branch" . act) insides
      traverse_ pass insides
      requestStopAsync cause (map SomeBranch (started :: [Branch ()]))
      note entries "requested"
      open mayEnd
      pure (pure ())
    (end, done) `shouldBe` (Gave (), ["requested"])

  it "gives the outcome of each branch, and turns it back into a result or an exception" $
    inScope $ \scope -> do
      well <- branch scope "branch" (pure 'a')
      badly <- branch scope "branch" (failed :: IO Char)
      (outcomeToIO =<< awaitOutcome well) `shouldReturn` 'a'
      (outcomeToIO =<< atomically (outcome well)) `shouldReturn` 'a'
      (outcomeToIO =<< atomically (outcome badly)) `shouldThrow` (== Failed)
      pure (pure ())

  it "does not lose the stop request of another thread, which a branch throws as it stops" $ do
    self <- myThreadId
    begun <- newGate
    let other = Stop self (SiblingFinished "sibling")
    ending (pass begun `parallel` ((open begun >> hang) `onException` throwIO other))
      `shouldReturn` CancelledBy (show other)

  it "does not let a cancellation that arrives while branches stop interrupt the caller's handlers" $ do
    inside <- newGate
    cleaning <- newGate
    mayEnd <- newGate
    (end, done) <- observing $ \entries -> do
      let operator = inScope $ \scope -> do
            _ <-
              branch scope "branch" (uninterruptibly (open inside >> hang) (open cleaning >> pass mayEnd))
                :: IO (Branch ())
            pass inside
            pure (failed :: IO ())
          -- Otherwise the handler of the failure would be run, and interrupted.
          handled = operator `catch` \(_ :: Failed) -> note entries "handler"
      withThread handled $ \caller -> do
        pass cleaning
        throwing (asyncThreadId caller) (Cancel "caller")
        open mayEnd
        awaitEnd caller
    (end, done) `shouldBe` (Gave (CancelledBy (show (Cancel "caller"))), [])

  it "throws an exception that arrives while branches stop before a handler of the caller runs" $
    void . explore (randomly 1000) $ \simulated -> do
      entries <- newLog
      let operator = both (sleep 1 >> failed) (sleep 2)
          handled = operator `catch` \(_ :: Failed) -> allowInterrupt `onException` note entries "in the handler"
      _ <- simulated (parallel handled (sleep 1))
      notes entries `shouldReturn` []

  it "gives a masked caller the verdict's result, though the caller is cancelled while branches stop" $ do
    cleaning <- newGate
    mayEnd <- newGate
    (end, done) <- observing $ \entries -> do
      let operator = inScope $ \scope -> do
            inside <- newGate
            _ <-
              branch scope "branch" (uninterruptibly (open inside >> hang) (open cleaning >> pass mayEnd))
                :: IO (Branch ())
            pass inside
            pure (pure "verdict")
      withThread (mask_ (operator >>= note entries) >> hang :: IO ()) $ \caller -> do
        pass cleaning
        throwing (asyncThreadId caller) (Cancel "caller")
        open mayEnd
        awaitEnd caller
    (end, done) `shouldBe` (Gave (CancelledBy (show (Cancel "caller"))), ["verdict"])

  for_ [toException BlockedIndefinitelyOnMVar, toException BlockedIndefinitelyOnSTM] $ \deadlock ->
    it ("throws a branch's fault rather than " ++ show deadlock) $ do
      inside <- newGate
      let operator = inScope $ \scope -> do
            _ <- branch scope "branch" ((open inside >> hang) `onException` throwIO (Fault "branch")) :: IO (Branch ())
            hang :: IO (IO ())
      withThread operator $ \caller -> do
        pass inside
        throwing (asyncThreadId caller) deadlock
        awaitEnd caller `shouldReturn` FaultedWith (show (Fault "branch"))

  it "does not lose an exception that arrives when a branch has faulted" $
    void . explore (randomly 1000) $ \simulated -> do
      let handled = (both (sleep 1 >> throwIO (Fault "branch")) (sleep 2) `catch` \(Fault _) -> pure ()) >> sleep 10
      run <- simulated (parallel handled (sleep 1))
      finished run `shouldBe` 1

  it "can be interrupted by a cleanup also after GHC has taken the caller for deadlocked" $ do
    gates@[inside, deeper, mayEnd, mayThrow] <- replicateM 4 newGate
    cleaning <- newGate
    caller <- newEmptyMVar
    let operator = inScope $ \scope -> do
          myThreadId >>= putMVar caller
          _ <-
            branch scope "first" (uninterruptibly (open inside >> hang) (open cleaning >> pass mayEnd))
              :: IO (Branch ())
          _ <-
            branch scope "second" $
              uninterruptibly (open deeper >> hang) (pass mayThrow >> readMVar caller >>= (`throwTo` Cancel "cleanup"))
              :: IO (Branch ())
          traverse_ pass (take 2 gates)
          pure (pure ())
    withThread operator $ \thread -> do
      pass cleaning
      throwing (asyncThreadId thread) BlockedIndefinitelyOnSTM
      openAll [mayEnd, mayThrow]
      awaitEnd thread `shouldReturn` CancelledBy (show (Cancel "cleanup"))

  for_ [("interrupts", 1), ("recovers first", 0)] $ \(manner, moment) ->
    it ("stops all threads of a monitor that " ++ manner ++ " and is cancelled while it makes its stop requests") $
      void . explore (randomly 1000) $ \simulated -> do
        let due = Signal.polling 1 ((>= moment) <$> now)
        run <- simulated (parallel (Signal.monitor ((&&) <$> due <*> due) (pure ()) hang) (sleep moment))
        finished run `shouldBe` moment
 where
  -- An operator with this verdict.
  inScope body = structured "operator" (fmap (Verdict cause) . body)
  cause = SiblingFinished "sibling"

pairs :: Spec
pairs = do
  it "is a cancellation, and no handler for the fault's type catches it" $ do
    let pair = StoppedWithFault (toException (Cancel "user")) (toException (Fault "bug"))
    (throwIO pair `catch` \(_ :: SomeAsyncException) -> pure "cancelled") `shouldReturn` "cancelled"
    ending (throwIO pair `catch` \(_ :: Fault) -> pure ())
      `shouldReturn` CancelledWithFault (show (Cancel "user")) (show (Fault "bug"))

  it "shows both exceptions that it holds" $ do
    let pair = StoppedWithFault (toException (Cancel "user")) (toException (Fault "bug"))
    show (Just pair) `shouldBe` "Just (StoppedWithFault (Cancel \"user\") (Fault \"bug\"))"
    displayException pair `shouldBe` "stopped by Cancel \"user\", and while stopping: Fault \"bug\""

  it "stays a pair where a branch throws it that was not stopped" $ do
    let pair = StoppedWithFault (toException (Cancel "user")) (toException (Fault "bug"))
    ending (parallel (throwIO pair :: IO ()) (hang :: IO ()))
      `shouldReturn` CancelledWithFault (show (Cancel "user")) (show (Fault "bug"))

  it "has the cause of its cancellation" $ do
    self <- myThreadId
    let stop = toException (Stop self (SiblingFinished "left"))
    causeOf (toException (StoppedWithFault stop (toException (Fault "bug")))) `shouldBe` SiblingFinished "left"
