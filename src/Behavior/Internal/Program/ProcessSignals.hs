{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE CPP #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Handling SIGINT, SIGTERM and SIGHUP, which belong to the whole process.
--
-- GHC calls a handler in a new thread, some time after the signal: by then the run that
-- installed it may have ended, and another may have begun. So there is a single handler for
-- all runs, which looks up the current runs when it is called. No signal is lost:
--
-- (A) While there are runs, all of them receive the signal.
--
-- (B) When there is no run any more, the handler that was installed before the first run is called, or the
--     signal is raised again for that handler.
--
-- (C) A signal whose handler GHC has not yet called is dropped if that handler is replaced by
--     the default. So where the default was installed before, this handler stays installed,
--     and does (B).
--
-- (D) GHC calls no handler while a loop that never allocates keeps it from running other threads.
--     Then the second signal ends the process (in @signals.c@).
--
-- (E) The program may end before GHC has called a handler. So a run that ends waits (at most a second) until
--     the handlers of all signals that have come have been called; and when there is no run any more,
--     @signals.c@ does the default, at once.
--
-- Two things are special about SIGHUP. Where it is ignored when the first run begins (by nohup),
-- it stays ignored. And when a terminal is closed, the shell and the kernel send one each: at the
-- same time, or as far apart as the shell's exit trap takes. So a SIGHUP has no effect while runs are
-- being stopped; and for ten seconds after the signal that stopped them it does not end the process,
-- because the caller of the last one may still clean up.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Program.ProcessSignals
  ( withSignals
  ) where

#if defined(mingw32_HOST_OS)
import Control.Concurrent.STM (STM, retry)

-- | Runs the action with a transaction that waits for a signal. (On Windows it waits for ever.)
withSignals :: (STM (String, Int) -> IO a) -> IO a
withSignals act = act retry
#else
import Control.Concurrent (forkIOWithUnmask, threadDelay)
import Control.Concurrent.MVar
  ( MVar
  , modifyMVar
  , modifyMVar_
  , newEmptyMVar
  , newMVar
  , putMVar
  , readMVar
  , withMVar
  )
import Control.Concurrent.STM (STM, TVar, newTVarIO, readTVar, readTVarIO, retry, writeTVar)
import Control.Concurrent.STM.TVar (mkWeakTVar)
import Control.Exception (bracket, finally, uninterruptibleMask_)
import Control.Monad (filterM, join, unless, void, when)
import Data.Foldable (for_)
import Data.IORef (IORef, atomicModifyIORef', newIORef)
import Data.Maybe (catMaybes, fromMaybe)
import Data.Traversable (for)
import Foreign.C (CInt (..))
import GHC.Clock (getMonotonicTime)
import System.IO.Unsafe (unsafePerformIO)
import System.Mem.StableName (eqStableName, makeStableName)
import System.Mem.Weak (Weak, deRefWeak)
import System.Posix.Process (getProcessID)
import System.Posix.Signals (Handler (..), Signal, installHandler, raiseSignal, sigHUP, sigINT, sigTERM)
import System.Posix.Types (ProcessID)
import System.Timeout (timeout)

import Behavior.Internal.Seam.Runtime (atomically)

-- | Runs the action with a transaction that waits for a signal, and gives its name and the
-- exit code for it. A signal that was received while the action ran, but was not taken by that
-- transaction, is raised again when the action has ended.
withSignals :: (STM (String, Int) -> IO a) -> IO a
withSignals act = bracket enter leave $ \(_, state) ->
  act $
    readTVar state >>= \case
      Received signal -> (nameOf signal, exitCode signal) <$ writeTVar state Taken
      _ -> retry

-- | Whether a run has received a signal.
data State
  = NoSignal
  | Received Signal
  | Taken
  deriving (Eq)

-- | The state that the handler uses.
data Process = Process
  { runs :: [(Int, Weak (TVar State))]
  -- ^ The runs that have not ended, each with its number, the newest first. The references are
  -- weak: if the handler kept a waiting thread reachable, GHC could not detect a deadlock.
  , before :: [(Signal, Handler)]
  -- ^ The handlers that were installed before the first of these runs.
  , pending :: Maybe Signal
  -- ^ The signal that the runs have received, unless one of them has taken it.
  , defaulted :: Bool
  -- ^ Whether the first signal has come: the next SIGINT or SIGTERM ends the process at once.
  , noHangupUntil :: Double
  -- ^ Until then, in seconds of the monotonic clock, a SIGHUP does not end the process.
  }

nothingRuns :: Process
nothingRuns = Process {runs = [], before = [], pending = Nothing, defaulted = False, noHangupUntil = 0}

-- | The state of the current process. (A process made by @forkProcess@ has none of the runs of the
-- original process. And there the original's state may be locked for ever: by a thread that was not copied.)
process :: IO (MVar Process)
process = do
  self <- getProcessID
  new <- newMVar nothingRuns
  atomicModifyIORef' owned $ \known@(owner, state) -> if owner == self then (known, state) else ((self, new), new)

-- | The process that was the current one, and its state.
owned :: IORef (ProcessID, MVar Process)
owned = unsafePerformIO (newMVar nothingRuns >>= newIORef . (,) 0)
{-# NOINLINE owned #-}

-- | Begins a run. (A run that begins while others are being stopped belongs to a cleanup; the
-- second signal ends it with them.)
enter :: IO (Int, TVar State)
enter = do
  state <- newTVarIO NoSignal
  weakly <- mkWeakTVar state (pure ())
  current <- process
  modifyMVar current $ \known -> do
    installed <- if null (runs known) then install known else pure known
    let n = 1 + maximum (0 : map fst (runs installed))
    pure (installed {runs = (n, weakly) : runs installed}, (n, state))
 where
  install known = do
    handled <- filterM (fmap not . isIgnoredHangup . fst) handlers
    old <- for handled $ \(signal, handler) -> do
      handlerBefore <- installHandler signal handler Nothing
      -- (C)
      stayed <- isOurs signal handlerBefore
      watch signal
      pure (signal, if stayed then Default else handlerBefore)
    pure known {before = old}

-- | Ends a run. (The wait after it can be interrupted: a handler may throw to this thread.)
leave :: (Int, TVar State) -> IO ()
leave (n, state) = do
  current <- process
  join . uninterruptibleMask_ $ do
    -- (E)
    allAnswered
    modifyMVar current $ \known -> do
      end <- readTVarIO state
      let others = filter ((/= n) . fst) (runs known)
          left = known {runs = others, pending = if end == Taken then Nothing else pending known}
      if null (runs left) then restore left else pure (left, pure ())
  allAnswered
  withMVar current (const (pure ()))
 where
  restore left = do
    let noHangup = maybe (noHangupUntil left) (const 0) (pending left)
    answer
    for_ (before left) $ \case
      (signal, Default) -> unless (signal == sigHUP && noHangup > 0) (rest signal)
      (signal, handler) -> void (installHandler signal handler Nothing)
    handled <- for (pending left) $ \signal -> raiseFor (lookup signal (before left)) signal
    pure (nothingRuns {noHangupUntil = noHangup}, fromMaybe (pure ()) handled)

-- | Raises the signal for the handler, and gives the action that waits, at most a second, until the
-- handler has ended. (GHC would call it some time later, when the program may have ended.)
raiseFor :: Maybe Handler -> Signal -> IO (IO ())
raiseFor (Just (Catch act)) _ = do
  done <- newEmptyMVar
  _ <- forkIOWithUnmask $ \unmask -> unmask act `finally` putMVar done ()
  pure (void (timeout 1000000 (readMVar done)))
raiseFor _ signal = pure () <$ raiseSignal signal

-- | Waits, at most a second, until the handler has been called for each signal that has come.
allAnswered :: IO ()
allAnswered = wait (1000 :: Int)
 where
  wait left = do
    open <- unanswered
    when (open /= 0 && left > 0) $ threadDelay 1000 >> wait (left - 1)

-- | The handler of a signal.
received :: Signal -> IO ()
received signal = uninterruptibleMask_ $ do
  current <- process
  t <- getMonotonicTime
  modifyMVar_ current $ \known -> do
    -- (A thread that has seen the answer, and locks the state then, comes after this handler.)
    answer
    there <- catMaybes <$> traverse (deRefWeak . snd) (runs known)
    case there of
      -- (B)
      [] -> known <$ passOn (signal == sigHUP && t < noHangupUntil known) signal
      _
        -- It is a SIGHUP, or came together with the first one, before the default was installed.
        | defaulted known -> pure known
        | otherwise -> do
            atomically (for_ there (`writeTVar` Received signal))
            for_ [sigINT, sigTERM] $ \each -> installHandler each Default Nothing
            pure known {pending = Just signal, defaulted = True, noHangupUntil = t + 10}

-- | Raises the signal for the handler that is installed; if that is ours, the default was
-- installed before, and the process ends, unless it has been stopped just now.
passOn :: Bool -> Signal -> IO ()
passOn justStopped signal = do
  -- Reading a handler replaces it. With ours in its place no signal is lost meanwhile.
  for_ (lookup signal handlers) $ \ours -> do
    there <- installHandler signal ours Nothing
    stayed <- isOurs signal there
    unless (stayed && justStopped) $ do
      _ <- installHandler signal (if stayed then Default else there) Nothing
      raiseSignal signal

-- | Whether the handler is the one that this module installs.
isOurs :: Signal -> Handler -> IO Bool
isOurs signal there = case (lookup signal handlers, there) of
  (Just (Catch ours), Catch act) -> do
    ourName <- ours `seq` makeStableName ours
    name <- act `seq` makeStableName act
    pure (eqStableName ourName name)
  _ -> pure False

-- | The handlers of this module. (Evaluated once, so that they can be compared.)
handlers :: [(Signal, Handler)]
handlers = [(sigINT, Catch onInterrupt), (sigTERM, Catch onTermination), (sigHUP, Catch onHangup)]
{-# NOINLINE handlers #-}

onInterrupt, onTermination, onHangup :: IO ()
onInterrupt = received sigINT
onTermination = received sigTERM
onHangup = received sigHUP
{-# NOINLINE onInterrupt #-}
{-# NOINLINE onTermination #-}
{-# NOINLINE onHangup #-}

-- | Whether it is SIGHUP, and the process ignores it.
isIgnoredHangup :: Signal -> IO Bool
isIgnoredHangup signal
  | signal == sigHUP = (/= 0) <$> ignores signal
  | otherwise = pure False

-- | Whether the process ignores the signal: 1 or 0.
foreign import ccall unsafe "behavior_lang_ignores" ignores :: CInt -> IO CInt

-- | Lets the second of two signals, if no Haskell thread has answered the first for two seconds,
-- print why and end the process. To be called when the handler has been installed.
foreign import ccall unsafe "behavior_lang_watch" watch :: CInt -> IO ()

-- | From now on the signal has its default effect at once, until 'watch' is called.
foreign import ccall unsafe "behavior_lang_rest" rest :: CInt -> IO ()

-- | Whether a signal has not been answered: 1 or 0.
foreign import ccall unsafe "behavior_lang_unanswered" unanswered :: IO CInt

-- | The answer to a signal.
foreign import ccall unsafe "behavior_lang_answer" answer :: IO ()

-- | The name of a signal that is handled here.
nameOf :: Signal -> String
nameOf signal
  | signal == sigINT = "SIGINT"
  | signal == sigTERM = "SIGTERM"
  | otherwise = "SIGHUP"

-- | The exit code that a shell shows for a process that was ended by the signal.
exitCode :: Signal -> Int
exitCode signal = 128 + fromIntegral signal
#endif
