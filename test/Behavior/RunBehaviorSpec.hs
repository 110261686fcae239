{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- 'runBehavior', with signals that this process raises itself. (A process that has to end
-- is a child.)
module Behavior.RunBehaviorSpec (spec) where

import Control.Concurrent
import Control.Concurrent.Async (asyncThreadId, poll, wait, waitCatchSTM, withAsyncBound)
import Control.Exception
import Control.Monad (forever, join, replicateM_, unless, void, when)
import Data.Either (fromLeft)
import Data.Foldable (for_)
import Data.IORef (modifyIORef, newIORef, readIORef)
import Data.List (nub, sort)
import Data.Maybe (isNothing)
import Foreign.C (CInt (..))
import GHC.Conc (ThreadStatus (..), threadStatus)
import System.Exit (ExitCode (..))
import System.IO (hFlush, hGetContents, hGetLine, hPutStrLn, stderr, stdout)
import System.Posix.IO (closeFd, createPipe, dupTo, fdToHandle, stdError)
import System.Posix.Process (ProcessStatus (..), exitImmediately, forkProcess, getProcessStatus)
import System.Posix.Signals
import Test.Hspec

import Behavior
import Behavior.Internal.Seam.Runtime (Label (..), atomically, awaitUninterruptibly)
import Behavior.Sim (exhaustively, explore, well)
import Support

spec :: Spec
spec = guarded . describe "runBehavior" $ do
  it "gives the result, the failure or the fault of the behaviour" $ do
    runBehavior (pure 'a') `shouldReturn` 'a'
    (runBehavior failed :: IO ()) `shouldThrow` (== Failed)
    (runBehavior (throwIO (Fault "bug")) :: IO ()) `shouldThrow` (== Fault "bug")

  it "runs it in an unbound thread, labelled, and unmasked" $ do
    (end, events) <- observing $ \entries ->
      bound (watchingThreads (note entries) (mask_ (runBehavior ((,) <$> isCurrentThreadBound <*> getMaskingState))))
    end `shouldBe` Gave (False, Unmasked)
    events `shouldBe` [Started (Label "runBehavior" "program"), Ended (Label "runBehavior" "program")]

  for_ endings $ \(signal, otherSignal, name, code) -> around_ (unignored signal) $ do
    it ("ends with " ++ show code ++ " after a " ++ name ++ ", when the cleanups have ended") $ do
      entries <- newLog
      cleaning <- newGate
      mayEnd <- newGate
      let act = uninterruptibly (raiseSignal signal >> hang) $ do
            open cleaning
            pass mayEnd
            note entries "cleaned up"
      withThread (leavingNothing (runBehavior act)) $ \caller -> do
        pass cleaning
        stillRunning caller
        open mayEnd
        wait caller `shouldThrow` (== ExitFailure code)
        notes entries `shouldReturn` ["cleaned up"]

    it ("ends with " ++ show code ++ " after a " ++ name ++ ", also if the behaviour nevertheless completes or fails") $
      for_ [pure (), failed] $ \end ->
        runBehavior ((raiseSignal signal >> hang) `catch` \(_ :: SomeAsyncException) -> end)
          `shouldThrow` (== ExitFailure code)

    it ("does not let ? treat a " ++ name ++ " as a failure") $ do
      (_, done) <- observing $ \entries ->
        runBehavior ((raiseSignal signal >> hang) ? note entries "went on")
      done `shouldBe` []

    it ("throws a fault of a cleanup after a " ++ name) $
      runBehavior ((raiseSignal signal >> hang) `onException` throwIO (Fault "cleanup") :: IO ())
        `shouldThrow` (== Fault "cleanup")

    it ("restores at its end the handler of " ++ name ++ " that was installed before") $
      for_ [pure (), failed, throwIO (Fault "bug"), raiseSignal signal >> hang] $ \act -> do
        withHandler signal $ \received -> do
          _ <- try (runBehavior act) :: IO (Either SomeException ())
          raiseSignal signal
          takeMVar received

    unless (signal == sigHUP) . it ("ends the process at once at a second " ++ name ++ ", even during a cleanup") $
      inChild (runBehavior (uninterruptibly (raiseSignal signal >> hang) (raiseSignal signal >> hang)))
        >>= (`shouldBe` Terminated signal False)

    it ("does not end the process at a SIGHUP after a " ++ name ++ ": the cleanup runs to its end") $
      inChild
        ( byDefault sigHUP
            >> runBehavior (uninterruptibly (raiseSignal signal >> hang) (installed sigHUP >>= replicateM_ 2))
        )
        >>= (`shouldBe` Exited (ExitFailure code))

    it ("does not end the process at a SIGHUP soon after a " ++ name ++ ": its caller cleans up") $ do
      let hangups = installed sigHUP >>= replicateM_ 2
          cleanup = hangups >> runBehavior (pure ()) >> hangups >> throwIO (ExitFailure 7)
      inChild (byDefault sigHUP >> (runBehavior (raiseSignal signal >> hang) `finally` cleanup))
        >>= (`shouldBe` Exited (ExitFailure 7))

    it ("ends the process at once at a signal of the other kind after a " ++ name) $
      inChild (runBehavior (uninterruptibly (raiseSignal signal >> hang) (raiseSignal otherSignal >> hang)))
        >>= (`shouldBe` Terminated otherSignal False)

    it ("treats a second " ++ name ++ " that arrives with the first one as the same signal") $ do
      let twice = installed signal >>= \handler -> (handler >> hang) `onException` handler
      inChild (byDefault signal >> runBehavior twice) >>= (`shouldBe` Exited (ExitFailure code))

    it ("gives a result that is available, though a " ++ name ++ " came before it") $
      withHandler signal $ \received -> do
        -- (Which of them the caller sees first is a matter of the schedule: so of all.)
        ends <- newIORef []
        void . explore (exhaustively 1) $ \simulated -> do
          end <- simulated (try (runBehavior ('a' <$ join (installed signal)))) >>= well
          either (const (pure ())) (const (takeMVar received)) end
          modifyIORef ends (end :)
        nub . sort <$> readIORef ends `shouldReturn` [Left (ExitFailure code), Right 'a']

    it ("ignores a " ++ name ++ " after the end, where it was ignored before") $
      bracket (installHandler signal Ignore Nothing) (\old -> installHandler signal old Nothing) $ \_ -> do
        runBehavior (pure ())
        there <- installHandler signal Ignore Nothing
        case there of
          Ignore -> pure ()
          _ -> expectationFailure "another handler is installed"

    it ("cancels by a " ++ name ++ " a behaviour that still runs when others, begun before and after it, have ended") $
      withHandler signal $ \_ -> do
        began <- newGate
        mayEnd <- newGate
        inside <- newGate
        withThread (runBehavior (open began >> pass mayEnd)) $ \earlier -> do
          pass began
          withThread (runBehavior (open inside >> hang)) $ \caller -> do
            pass inside
            open mayEnd
            wait earlier
            runBehavior (pure ())
            raiseSignal signal
            (wait caller :: IO ()) `shouldThrow` (== ExitFailure code)

    it ("passes a " ++ name ++ " whose handler starts after the end to the handler that was installed before") $
      withHandler signal $ \received -> do
        join (runBehavior (installed signal))
        takeMVar received

    it ("passes a " ++ name ++ " whose handler starts after the end to a handler that was installed meanwhile") $ do
      late <- runBehavior (installed signal)
      withHandler signal $ \received -> late >> takeMVar received

    it ("cancels the next behaviour by a " ++ name ++ " whose handler starts after the end of the one before") $ do
      late <- runBehavior (installed signal)
      runBehavior (late >> hang) `shouldThrow` (== ExitFailure code)

    it ("passes a " ++ name ++ " to the handler that was installed before when the caller was cancelled first") $
      withHandler signal $ \received -> do
        inside <- newGate
        let act = (open inside >> hang) `onException` join (installed signal)
        cancelling (runBehavior act) (pass inside)
          `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())
        takeMVar received

    it ("returns only after a " ++ name ++ " at the very end of the behaviour has had its effect") $ do
      replicateM_ 20 $
        inChild (byDefault signal >> runBehavior (raiseSignal signal))
          >>= (`shouldSatisfy` (`elem` [Terminated signal False, Exited (ExitFailure code)]))
      withHandler signal $ \received ->
        replicateM_ 20 $
          try (runBehavior (raiseSignal signal)) >>= \case
            Left end -> end `shouldBe` ExitFailure code
            Right () -> tryTakeMVar received `shouldReturn` Just ()

    it ("ends the process by a " ++ name ++ " after the end, where that is the default") $ do
      inChild (byDefault signal >> runBehavior (pure ()) >> raiseSignal signal >> hang)
        >>= (`shouldBe` Terminated signal False)
      inChild (byDefault signal >> runBehavior (pure ()) >> raiseSignal signal)
        >>= (`shouldBe` Terminated signal False)
      inChild (byDefault signal >> replicateM_ 100 (runBehavior (pure ())) >> raiseSignal signal >> hang)
        >>= (`shouldBe` Terminated signal False)
      inChild (byDefault signal >> join (runBehavior (installed signal)) >> hang)
        >>= (`shouldBe` Terminated signal False)

    it ("cancels by a " ++ name ++ " all that run, side by side or one inside the other") $ do
      inside <- newGate
      withThread (runBehavior (runBehavior (open inside >> hang))) $ \other -> do
        pass inside
        (runBehavior (raiseSignal signal >> hang) :: IO ()) `shouldThrow` (== ExitFailure code)
        (wait other :: IO ()) `shouldThrow` (== ExitFailure code)

    it ("throws the exit code in the thread that called it after a " ++ name ++ "; the process continues") $
      inChild
        ( do
            end <- newEmptyMVar
            _ <- forkIO (try (runBehavior (raiseSignal signal >> hang)) >>= putMVar end)
            takeMVar end >>= (`shouldBe` (Left (ExitFailure code) :: Either ExitCode ()))
            throwIO (ExitFailure 7)
        )
        >>= (`shouldBe` Exited (ExitFailure 7))

    it ("does not handle a " ++ name ++ " in a process that the behaviour has forked and where it does not run") $ do
      runBehavior (inChild (raiseSignal signal >> hang)) >>= (`shouldBe` Terminated signal False)
      runBehavior (inChild (runBehavior (raiseSignal signal >> hang))) >>= (`shouldBe` Exited (ExitFailure code))

    it ("ends the process with the exit code " ++ show code ++ " after a " ++ name) $
      inChild (runBehavior (raiseSignal signal >> hang))
        >>= (`shouldBe` Exited (ExitFailure code))

  around_ (unignored sigHUP) . it "leaves a SIGHUP ignored that is ignored when it begins" $ do
    _ <- installHandler sigHUP Ignore Nothing
    for_ [runBehavior, runBehavior . runBehavior] $ \run ->
      run (installHandler sigHUP Ignore Nothing) >>= \case
        Ignore -> pure ()
        _ -> expectationFailure "a handler is installed"

  -- (Beside another run, so that none of them installs a handler: GHC's lock for that may be held in the
  -- forked process for ever. A program without this library hangs likewise.)
  it "begins in a process that is forked while, in other threads, behaviours begin and end" $ do
    runs <- newGate
    withThread (runBehavior (open runs >> hang)) $ \_ -> do
      pass runs
      withThread (forever (runBehavior (pure ()))) $ \_ -> withThread (forever (runBehavior (pure ()))) $ \_ ->
        replicateM_ 50 $ inChild (runBehavior (pure ())) >>= (`shouldBe` Exited ExitSuccess)

  it "ends the process at a second SIGTERM while a loop that never allocates runs, and prints why" $ do
    -- Sometimes another thread runs before the loop begins, and answers the first signal.
    let unanswered n = spinning >>= \end -> if null (snd end) && n > (0 :: Int) then unanswered (n - 1) else pure end
    (end, printed) <- unanswered 20
    end `shouldBe` Terminated sigTERM False
    printed `shouldContain` "-fno-omit-yields"

  it "waits for an action in runInBoundThread, which nothing interrupts" $
    when rtsSupportsBoundThreads $ do
      entries <- newLog
      inside <- newGate
      mayEnd <- newGate
      let act = runInBoundThread (open inside >> pass mayEnd >> note entries "to its end")
      withThread (runBehavior act) $ \caller -> do
        pass inside
        throwing (asyncThreadId caller) (Cancel "the caller")
        -- It waits: in the stop request, or for the end.
        eventually (isBlocked <$> threadStatus (asyncThreadId caller))
        poll caller >>= (`shouldBe` True) . isNothing
        open mayEnd
        awaitEnd caller `shouldReturn` CancelledBy (show (Cancel "the caller"))
      notes entries `shouldReturn` ["to its end"]

  it "interrupts an action in a bound thread that withAsyncBound has started" $
    when rtsSupportsBoundThreads $ do
      entries <- newLog
      inside <- newGate
      let act = (open inside >> hang) `onException` note entries "cleaned up"
      cancelling (runBehavior (withAsyncBound act wait)) (pass inside)
        `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())
      notes entries `shouldReturn` ["cleaned up"]

  it "does not return before the behaviour has ended when its caller is cancelled" $ do
    entries <- newLog
    inside <- newGate
    let act = (open inside >> hang) `onException` note entries "cleaned up"
    cancelling (leavingNothing (runBehavior act)) (pass inside)
      `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())
    notes entries `shouldReturn` ["cleaned up"]

  it "lets GHC detect that all threads are deadlocked" $ do
    found <- newGate
    inside <- newGate
    let deadlock = open inside >> newEmptyMVar >>= takeMVar :: IO ()
    _ <- forkIO $ pass inside >> collectingUntil found
    withThread (runBehavior deadlock) $ \caller -> do
      end <- endingOf <$> awaitUninterruptibly (atomically (waitCatchSTM caller))
      open found
      end `shouldBe` FaultedWith (show BlockedIndefinitelyOnMVar)
 where
  endings = [(sigINT, sigTERM, "SIGINT", 130), (sigTERM, sigINT, "SIGTERM", 143), (sigHUP, sigTERM, "SIGHUP", 129)]
  isBlocked = \case
    ThreadBlocked _ -> True
    _ -> False
  bound act = if rtsSupportsBoundThreads then runInBoundThread act else act

-- | A child in a loop that never allocates, which gets SIGTERM again and again: how it ended, and what
-- it has printed.
spinning :: IO (ProcessStatus, String)
spinning = do
  (output, input) <- createPipe
  child <- forkProcess $ do
    _ <- dupTo input stdError
    closeFd output
    closeFd input
    _ <- scheduleAlarm 20
    byDefault sigTERM
    setNumCapabilities 1
    let loop = void (evaluate ('a' `elem` cycle "b"))
    end <- try (runBehavior (hPutStrLn stderr "now" >> raiseHere sigTERM >> loop))
    exitImmediately (fromLeft ExitSuccess end)
  closeFd input
  printed <- fdToHandle output
  hGetLine printed `shouldReturn` "now"
  -- (The child looks at a clock that a test cannot advance. Without -threaded GHC keeps 16 signals that have no handler
  -- yet, and ends the program at the next.)
  let untilEnded =
        signalProcess sigTERM child >> getProcessStatus False False child
          >>= maybe (threadDelay 250000 >> untilEnded) pure
  (,) <$> untilEnded <*> hGetContents printed

-- | Raises it without letting another Haskell thread run.
foreign import ccall unsafe "raise" raiseHere :: Signal -> IO CInt

-- | The action of the installed handler.
installed :: Signal -> IO (IO ())
installed signal = do
  there <- installHandler signal Ignore Nothing
  _ <- installHandler signal there Nothing
  case there of
    Catch act -> pure act
    _ -> throwIO (ErrorCall "no handler")

-- | Runs the example without what has been set by the program that started the tests: nohup ignores
-- SIGHUP.
unignored :: Signal -> IO () -> IO ()
unignored signal = bracket (ignores signal <* byDefault signal) restore . const
 where
  restore ignored = void (installHandler signal (if ignored == 0 then Default else Ignore) Nothing)

foreign import ccall unsafe "behavior_lang_ignores" ignores :: Signal -> IO CInt

byDefault :: Signal -> IO ()
byDefault signal = void (installHandler signal Default Nothing)

-- | Runs it with a handler that fills the given 'MVar' when the signal arrives.
withHandler :: Signal -> (MVar () -> IO a) -> IO a
withHandler signal act = do
  received <- newEmptyMVar
  bracket
    (installHandler signal (Catch (putMVar received ())) Nothing)
    (\old -> installHandler signal old Nothing)
    (const (act received))

-- | Runs it as the program of a child process, and returns how that ended. An alarm kills
-- the child when it takes more than five seconds.
inChild :: IO () -> IO ProcessStatus
inChild program = do
  hFlush stdout -- otherwise the child would write it, too
  child <- forkProcess $ do
    _ <- scheduleAlarm 5
    end <- try program
    -- Immediately: what there is to clean up belongs to the parent.
    exitImmediately (fromLeft ExitSuccess end)
  getProcessStatus True False child >>= maybe (inChild program) pure
