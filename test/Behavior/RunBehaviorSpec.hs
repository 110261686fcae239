{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- 'runBehavior', with signals that this very process raises. (Where a process is to
-- end it is a child.)
module Behavior.RunBehaviorSpec (spec) where

import Control.Concurrent
import Control.Concurrent.Async (asyncThreadId, poll, wait, waitCatchSTM, withAsyncBound)
import Control.Exception
import Control.Monad (join, replicateM, replicateM_, void, when)
import Data.Either (fromLeft)
import Data.Foldable (for_)
import Data.Maybe (isNothing)
import GHC.Conc (ThreadStatus (..), threadStatus)
import System.Exit (ExitCode (..))
import System.IO (hFlush, stdout)
import System.Mem (performMajorGC)
import System.Posix.Process (ProcessStatus (..), exitImmediately, forkProcess, getProcessStatus)
import System.Posix.Signals
import Test.Hspec

import Behavior
import Behavior.Internal.Runtime (Event (..), Label (..), atomically, awaitUninterruptibly, withSink)
import Support

spec :: Spec
spec = guarded . describe "runBehavior" $ do
  it "gives the result, the failure or the fault of the behaviour" $ do
    runBehavior (pure 'a') `shouldReturn` 'a'
    (runBehavior failed :: IO ()) `shouldThrow` (== Failed)
    (runBehavior (throwIO (Fault "bug")) :: IO ()) `shouldThrow` (== Fault "bug")

  it "runs it in an unbound thread, labelled, and unmasked" $ do
    (end, events) <- observing $ \notebook -> withSink (note notebook) $
      bound (mask_ (runBehavior ((,) <$> isCurrentThreadBound <*> getMaskingState)))
    end `shouldBe` Gave (False, Unmasked)
    events `shouldBe` [Started (Label "runBehavior" "program"), Ended (Label "runBehavior" "program")]

  for_ [(sigINT, sigTERM, "SIGINT", 130), (sigTERM, sigINT, "SIGTERM", 143)] $ \(signal, otherSignal, name, code) -> do
    it ("ends with " ++ show code ++ " after a " ++ name ++ ", when the cleanups have ended") $ do
      notebook <- newLog
      cleaning <- newGate
      mayEnd <- newGate
      let act = uninterruptibly (raiseSignal signal >> hang) $ do
            open cleaning
            pass mayEnd
            note notebook "cleaned up"
      launching (leavingNothing (runBehavior act)) $ \caller -> do
        pass cleaning
        stillRunning caller
        open mayEnd
        wait caller `shouldThrow` (== ExitFailure code)
        notes notebook `shouldReturn` ["cleaned up"]

    it ("ends with " ++ show code ++ " after a " ++ name ++ " also if the behaviour completes or fails all the same") $
      for_ [pure (), failed] $ \end ->
        runBehavior ((raiseSignal signal >> hang) `catch` \(_ :: SomeAsyncException) -> end)
          `shouldThrow` (== ExitFailure code)

    it ("does not let ? take a " ++ name ++ " for a failure") $ do
      (_, done) <- observing $ \notebook ->
        runBehavior ((raiseSignal signal >> hang) ? note notebook "went on")
      done `shouldBe` []

    it ("throws a fault of a cleanup after a " ++ name) $
      runBehavior ((raiseSignal signal >> hang) `onException` throwIO (Fault "cleanup") :: IO ())
        `shouldThrow` (== Fault "cleanup")

    it ("leaves it to others what a " ++ name ++ " does, before and after") $
      for_ [pure (), failed, throwIO (Fault "bug"), raiseSignal signal >> hang] $ \act -> do
        withHandler signal $ \heard -> do
          _ <- try (runBehavior act) :: IO (Either SomeException ())
          raiseSignal signal
          takeMVar heard

    it ("ends the process at once at a second " ++ name ++ ", even during a cleanup") $
      inChild (runBehavior (uninterruptibly (raiseSignal signal >> hang) (raiseSignal signal >> hang)))
        >>= (`shouldBe` Terminated signal False)

    it ("ends the process at once at a signal of the other kind after a " ++ name) $
      inChild (runBehavior (uninterruptibly (raiseSignal signal >> hang) (raiseSignal otherSignal >> hang)))
        >>= (`shouldBe` Terminated otherSignal False)

    it ("takes a second " ++ name ++ " that came with the first one for the same") $ do
      let twice = installed signal >>= \handler -> (handler >> hang) `onException` handler
      inChild (byDefault signal >> runBehavior twice) >>= (`shouldBe` Exited (ExitFailure code))

    it ("gives a result that is there, though a " ++ name ++ " came before it") $
      withHandler signal $ \heard -> do
        -- (Not always: with two capabilities the signal may be seen before there is a result.)
        ends <- replicateM 100 $ do
          end <- try (runBehavior ('a' <$ join (installed signal)))
          either (const (pure ())) (const (takeMVar heard)) end
          pure end
        ends `shouldContain` [Right 'a' :: Either ExitCode Char]

    it ("ignores a " ++ name ++ " after the end, where it was ignored before") $
      bracket (installHandler signal Ignore Nothing) (\old -> installHandler signal old Nothing) $ \_ -> do
        runBehavior (pure ())
        there <- installHandler signal Ignore Nothing
        case there of
          Ignore -> pure ()
          _ -> expectationFailure "another handler is there"

    it ("cancels by a " ++ name ++ " what still runs when some have ended that began before and after it") $
      withHandler signal $ \_ -> do
        began <- newGate
        mayEnd <- newGate
        inside <- newGate
        launching (runBehavior (open began >> pass mayEnd)) $ \before' -> do
          pass began
          launching (runBehavior (open inside >> hang)) $ \caller -> do
            pass inside
            open mayEnd
            wait before'
            runBehavior (pure ())
            raiseSignal signal
            (wait caller :: IO ()) `shouldThrow` (== ExitFailure code)

    it ("gives a " ++ name ++ " whose handler starts after the end to the handler that was there before") $
      withHandler signal $ \heard -> do
        join (runBehavior (installed signal))
        takeMVar heard

    it ("gives a " ++ name ++ " whose handler starts after the end to a handler that was installed meanwhile") $ do
      late <- runBehavior (installed signal)
      withHandler signal $ \heard -> late >> takeMVar heard

    it ("cancels the next behaviour by a " ++ name ++ " whose handler starts after the end of the one before") $ do
      late <- runBehavior (installed signal)
      runBehavior (late >> hang) `shouldThrow` (== ExitFailure code)

    it ("gives a " ++ name ++ " to the handler that was there before when the caller was cancelled first") $
      withHandler signal $ \heard -> do
        inside <- newGate
        let act = (open inside >> hang) `onException` join (installed signal)
        cancelling (runBehavior act) (pass inside)
          `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())
        takeMVar heard

    it ("ends the process by a " ++ name ++ " after the end, where that is the default") $ do
      inChild (byDefault signal >> runBehavior (pure ()) >> raiseSignal signal >> hang)
        >>= (`shouldBe` Terminated signal False)
      inChild (byDefault signal >> replicateM_ 100 (runBehavior (pure ())) >> raiseSignal signal >> hang)
        >>= (`shouldBe` Terminated signal False)
      inChild (byDefault signal >> join (runBehavior (installed signal)) >> hang)
        >>= (`shouldBe` Terminated signal False)

    it ("cancels all that run by a " ++ name ++ ", side by side or one inside the other") $ do
      inside <- newGate
      launching (runBehavior (runBehavior (open inside >> hang))) $ \other -> do
        pass inside
        (runBehavior (raiseSignal signal >> hang) :: IO ()) `shouldThrow` (== ExitFailure code)
        (wait other :: IO ()) `shouldThrow` (== ExitFailure code)

    it ("throws the exit in the thread that called it after a " ++ name ++ "; the process goes on") $
      inChild
        ( do
            end <- newEmptyMVar
            _ <- forkIO (try (runBehavior (raiseSignal signal >> hang)) >>= putMVar end)
            takeMVar end >>= (`shouldBe` (Left (ExitFailure code) :: Either ExitCode ()))
            throwIO (ExitFailure 7)
        )
        >>= (`shouldBe` Exited (ExitFailure 7))

    it ("leaves a " ++ name ++ " alone in a process that the behaviour has forked, where nothing of it runs") $ do
      runBehavior (inChild (raiseSignal signal >> hang)) >>= (`shouldBe` Terminated signal False)
      runBehavior (inChild (runBehavior (raiseSignal signal >> hang))) >>= (`shouldBe` Exited (ExitFailure code))

    it ("makes it the exit code of the process after a " ++ name) $
      inChild (runBehavior (raiseSignal signal >> hang))
        >>= (`shouldBe` Exited (ExitFailure code))

  it "waits for an action in runInBoundThread, which nothing interrupts" $
    when rtsSupportsBoundThreads $ do
      notebook <- newLog
      inside <- newGate
      mayEnd <- newGate
      let act = runInBoundThread (open inside >> pass mayEnd >> note notebook "to its end")
      launching (runBehavior act) $ \caller -> do
        pass inside
        throwing (asyncThreadId caller) (Cancel "the caller")
        -- It waits: in the stop request, or for the end.
        eventually (isBlocked <$> threadStatus (asyncThreadId caller))
        poll caller >>= (`shouldBe` True) . isNothing
        open mayEnd
        awaitEnd caller `shouldReturn` CancelledBy (show (Cancel "the caller"))
      notes notebook `shouldReturn` ["to its end"]

  it "interrupts an action in a bound thread that withAsyncBound has started" $
    when rtsSupportsBoundThreads $ do
      notebook <- newLog
      inside <- newGate
      let act = (open inside >> hang) `onException` note notebook "cleaned up"
      cancelling (runBehavior (withAsyncBound act wait)) (pass inside)
        `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())
      notes notebook `shouldReturn` ["cleaned up"]

  it "does not return before the behaviour has ended when its caller is cancelled" $ do
    notebook <- newLog
    inside <- newGate
    let act = (open inside >> hang) `onException` note notebook "cleaned up"
    cancelling (leavingNothing (runBehavior act)) (pass inside)
      `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())
    notes notebook `shouldReturn` ["cleaned up"]

  it "lets GHC find out that everything is deadlocked" $ do
    found <- newGate
    inside <- newGate
    let deadlock = open inside >> newEmptyMVar >>= takeMVar :: IO ()
    _ <- forkIO $ pass inside >> untilOpen found (performMajorGC >> yield)
    launching (runBehavior deadlock) $ \caller -> do
      end <- endingOf <$> awaitUninterruptibly (atomically (waitCatchSTM caller))
      open found
      end `shouldBe` FaultedWith (show BlockedIndefinitelyOnMVar)
 where
  isBlocked = \case
    ThreadBlocked _ -> True
    _ -> False
  bound act = if rtsSupportsBoundThreads then runInBoundThread act else act

-- | The action of the handler that is there.
installed :: Signal -> IO (IO ())
installed signal = do
  there <- installHandler signal Ignore Nothing
  _ <- installHandler signal there Nothing
  case there of
    Catch act -> pure act
    _ -> throwIO (ErrorCall "no handler")

byDefault :: Signal -> IO ()
byDefault signal = void (installHandler signal Default Nothing)

-- | Runs it where a signal fills a box.
withHandler :: Signal -> (MVar () -> IO a) -> IO a
withHandler signal act = do
  heard <- newEmptyMVar
  bracket
    (installHandler signal (Catch (putMVar heard ())) Nothing)
    (\old -> installHandler signal old Nothing)
    (const (act heard))

-- | Runs it as the program of a child, and says how that one ended. It is killed by
-- an alarm when it takes more than five seconds.
inChild :: IO () -> IO ProcessStatus
inChild program = do
  hFlush stdout -- or the child would write it, too
  child <- forkProcess $ do
    _ <- scheduleAlarm 5
    end <- try program
    -- At once, for the child has nothing to clean up that is not its parent's.
    exitImmediately (fromLeft ExitSuccess end)
  getProcessStatus True False child >>= maybe (inChild program) pure
