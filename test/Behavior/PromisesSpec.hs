{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- The promises of every operator, in every place where an operator runs a behaviour.
module Behavior.PromisesSpec (spec) where

import Control.Concurrent
import Control.Concurrent.Async (asyncThreadId, cancel, race_, waitCatchSTM)
import Control.Exception
import Control.Monad (forM_, void)
import qualified System.Timeout as System
import Test.Hspec

import Behavior
import Behavior.Internal.Seam.Runtime (atomically, awaitUninterruptibly)
import Places
import Support

spec :: Spec
spec = guarded $ do
  describe "A cancelled operator" cancelled
  describe "A branch" branches
  describe "Operators within operators" nested

-- | An example for each of the places.
inEach :: [OperatorPlace] -> String -> (OperatorPlace -> IO ()) -> Spec
inEach these promise check =
  describe promise . forM_ these $ \place -> it (show place) (check place)

theCancel :: Cancel
theCancel = Cancel "the caller"

-- | The caller was cancelled, and nothing else happened.
isCancelled :: Ending ()
isCancelled = CancelledBy (show theCancel)

cancelled :: Spec
cancelled = do
  inEach places "throws the same exception when what it ran has ended, however slow its cleanup" $ \place -> do
    entries <- newLog
    inside <- newGate
    cleaning <- newGate
    mayEnd <- newGate
    let act = uninterruptibly (open inside >> hang) $ do
          open cleaning
          pass mayEnd
          note entries "cleaned up"
    withThread (leavingNothing (placed place act)) $ \caller -> do
      pass inside
      throwTo (asyncThreadId caller) theCancel
      pass cleaning
      stillRunning caller
      open mayEnd
      awaitEnd caller `shouldReturn` isCancelled
      notes entries `shouldReturn` ["cleaned up"]

  inEach places "waits for what it ran also when it is cancelled again, and again, meanwhile" $ \place -> do
    entries <- newLog
    inside <- newGate
    cleaning <- newGate
    mayEnd <- newGate
    let act = uninterruptibly (open inside >> hang) $ do
          open cleaning
          pass mayEnd
          note entries "cleaned up"
    withThread (leavingNothing (placed place act)) $ \caller -> do
      pass inside
      throwTo (asyncThreadId caller) theCancel
      pass cleaning
      throwing (asyncThreadId caller) (Cancel "again")
      throwing (asyncThreadId caller) (Cancel "and again")
      stillRunning caller
      open mayEnd
      awaitEnd caller `shouldReturn` isCancelled
      notes entries `shouldReturn` ["cleaned up"]

  inEach threaded "makes only one stop request: a second cancellation does not interrupt the cleanup" $ \place -> do
    entries <- newLog
    inside <- newGate
    cleaning <- newGate
    mayEnd <- newGate
    let act =
          (open inside >> hang) `onException` do
            open cleaning
            pass mayEnd -- which can be interrupted
            note entries "cleaned up"
    withThread (placed place act) $ \caller -> do
      pass inside
      throwTo (asyncThreadId caller) theCancel
      pass cleaning
      throwing (asyncThreadId caller) (Cancel "again")
      stillRunning caller
      open mayEnd
      awaitEnd caller `shouldReturn` isCancelled
      notes entries `shouldReturn` ["cleaned up"]

  inEach places "lets System.Timeout's timeout and async's cancel return" $ \place -> do
    System.timeout 1000 (placed place hang) `shouldReturn` Nothing
    inside <- newGate
    withThread (placed place (open inside >> hang)) $ \caller -> pass inside >> cancel caller

  inEach threaded "throws a fault of a cleanup together with the cancellation" $ \place -> do
    inside <- newGate
    cancelling (placed place ((open inside >> hang) `onException` throwIO (Fault "cleanup"))) (pass inside)
      `shouldReturn` CancelledWithFault (show theCancel) (show (Fault "cleanup"))

  inEach threaded "does not continue after a handler for the fault of a cleanup" $ \place -> do
    entries <- newLog
    inside <- newGate
    let act = placed place ((open inside >> hang) `onException` throwIO (Fault "cleanup"))
        handled = void (try act :: IO (Either Fault ())) >> note entries "went on"
    cancelling handled (pass inside)
      `shouldReturn` CancelledWithFault (show theCancel) (show (Fault "cleanup"))
    notes entries `shouldReturn` []

  inEach threaded "ends as cancelled also when what it stops fails or gives a result" $ \place -> do
    entries <- newLog
    forM_ [failed, pure ()] $ \end -> do
      inside <- newGate
      let act = (open inside >> hang) `catch` \(_ :: SomeAsyncException) -> end
      cancelling ((placed place act ? pure ()) >> note entries "went on") (pass inside)
        `shouldReturn` isCancelled
    notes entries `shouldReturn` []

  -- (Where 'abandoning' limits the wait, GHC does not take the cleanup for deadlocked.)
  inEach
    (filter ((/= "abandoning: branch") . placeName) threaded)
    "receives no deadlock exception while it waits for a cleanup that is deadlocked"
    $ \place -> do
      entries <- newLog
      inside <- newGate
      cleaning <- newGate
      recovered <- newGate
      let deadlock = newEmptyMVar >>= takeMVar :: IO ()
          act =
            (open inside >> hang) `onException` do
              open cleaning
              deadlock `catch` \BlockedIndefinitelyOnMVar -> note entries "recovered"
      -- GHC detects a deadlock when it collects garbage, which this thread makes it do; the
      -- thread holds no reference to any thread.
      _ <- forkIO $ pass cleaning >> collectingUntil recovered
      withThread (leavingNothing (placed place act)) $ \caller -> do
        pass inside
        throwTo (asyncThreadId caller) theCancel
        -- This thread is deadlocked as well.
        end <- endingOf <$> awaitUninterruptibly (atomically (waitCatchSTM caller))
        open recovered
        end `shouldBe` isCancelled
        notes entries `shouldReturn` ["recovered"]

branches :: Spec
branches = do
  inEach threaded "runs unmasked, whatever the caller's masking state" $ \place ->
    forM_ [id, mask_, uninterruptibleMask_] $ \inState ->
      snd <$> observing (\entries -> inState (placed place (getMaskingState >>= note entries)))
        `shouldReturn` [Unmasked]

  inEach inCaller "(a behaviour in the caller's thread) keeps the caller's masking state" $ \place ->
    forM_ [(id, Unmasked), (mask_, MaskedInterruptible), (uninterruptibleMask_, MaskedUninterruptible)] $
      \(inState, state) ->
        snd <$> observing (\entries -> inState (placed place (getMaskingState >>= note entries)))
          `shouldReturn` [state]

  inEach threaded "can be stopped where the operator is called masked, uninterruptibly, or in a handler" $ \place ->
    forM_ [mask_, uninterruptibleMask_, \act -> throwIO (Fault "bug") `catch` \(Fault _) -> act] $
      \inState -> do
        inside <- newGate
        inState (placed place (open inside >> hang) ||| pass inside)

  inEach threaded "is labelled with its operator and its name, and is reported when it starts and ends" $ \place -> do
    (_, events) <- observing $ \entries ->
      watchingThreads (note entries) (placed place (pure ()))
    let started = [label | Started label <- events]
        ended = [label | Ended label <- events]
    [label | label <- started, Just label == placeLabel place] `shouldSatisfy` ((== 1) . length)
    ended `shouldMatchList` started

  inEach places "ends its operator with its fault" $ \place ->
    ending (placed place (throwIO (Fault "bug"))) `shouldReturn` FaultedWith (show (Fault "bug"))

  inEach places "ends its operator with its failure" $ \place ->
    ending (placed place (throwIO theFailure)) `shouldReturn` FailedWith (show theFailure)

  inEach threaded "that is killed, not by its operator, ends the operator with what killed it" $ \place ->
    ending (placed place (myThreadId >>= killThread)) `shouldReturn` CancelledBy (show ThreadKilled)

  inEach threaded "throws a fault past every handler when an operator stops it" $ \place -> do
    entries <- newLog
    inside <- newGate
    let act = placed place ((open inside >> hang) `onException` throwIO (Fault "cleanup"))
        handled = void (try act :: IO (Either Fault ())) >> note entries "went on"
    ending (handled ||| pass inside) `shouldReturn` FaultedWith (show (Fault "cleanup"))
    notes entries `shouldReturn` []

  inEach threaded "does not mistake the stop request of another branch for its own" $ \place -> do
    stray <- usedStopRequest
    let isStray = CancelledBy (show stray)
    ending (placed place (throwIO stray)) `shouldReturn` isStray
    inside <- newGate
    let act = (open inside >> hang) `catch` \(_ :: SomeException) -> throwIO stray
    ending (placed place act ||| pass inside) `shouldReturn` isStray

-- | The exception by which an operator stopped a branch that has ended since.
usedStopRequest :: IO SomeException
usedStopRequest = do
  caught <- newEmptyMVar
  inside <- newGate
  ((open inside >> hang) `catch` \(e :: SomeException) -> putMVar caught e >> throwIO e) ||| pass inside
  takeMVar caught

nested :: Spec
nested = do
  inEach places "are stopped at the level where a stop is requested, and at no other" $ \place -> do
    let level :: (IO () -> IO () -> IO () -> IO ()) -> IO (Ending (Ending ()), [String])
        level which = do
          inside <- newGate
          inner <- newGate
          outer <- newGate
          observing $ \entries -> do
            let act = (open inside >> hang) `onException` note entries "cleaned up"
                operator = placed place ((act ||| pass inner) >> note entries "inner ended")
                whole = ((operator >> note entries "operator ended") ||| pass outer) >> note entries "outer ended"
            withThread whole $ \caller -> do
              pass inside
              which (open inner) (open outer) (throwTo (asyncThreadId caller) theCancel)
              awaitEnd caller
    level (\inner _ _ -> inner)
      `shouldReturn` (Gave (Gave ()), ["cleaned up", "inner ended", "operator ended", "outer ended"])
    level (\_ outer _ -> outer) `shouldReturn` (Gave (Gave ()), ["cleaned up", "outer ended"])
    level (\_ _ caller -> caller) `shouldReturn` (Gave isCancelled, ["cleaned up"])

  inEach places "are all stopped, in any order of nesting, when the outermost is cancelled" $ \place ->
    forM_ places $ \other -> do
      entries <- newLog
      inside <- newGate
      let act = (open inside >> hang) `onException` note entries (show other)
      end <- cancelling (leavingNothing (placed place (placed other act))) (pass inside)
      done <- notes entries
      (end, done) `shouldBe` (isCancelled, [show other])

  inEach places "are all stopped through threads of async's, and handlers that rethrow" $ \place ->
    forM_ places $ \other -> do
      entries <- newLog
      inside <- newGate
      let act = (open inside >> hang) `onException` note entries (show other)
          between inner = race_ (inner `catch` \(e :: SomeException) -> throwIO e) hang
      end <- cancelling (leavingNothing (placed place (between (placed other act)))) (pass inside)
      done <- notes entries
      (end, done) `shouldBe` (isCancelled, [show other])

  inEach threaded "rethrow a fault from any depth while they are stopped" $ \place ->
    forM_ threaded $ \other -> do
      inside <- newGate
      let act = placed place (placed other ((open inside >> hang) `onException` throwIO (Fault (show other))))
      cancelling act (pass inside)
        `shouldReturn` CancelledWithFault (show theCancel) (show (Fault (show other)))
