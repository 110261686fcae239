{-# LANGUAGE CPP #-}

-- |
-- The life of a program.
module Behavior.Internal.Program
  ( runBehavior
  ) where

import Control.Concurrent.STM (newTVarIO, orElse, readTVar, retry, writeTVar)
import Control.Exception (throwIO)
import System.Exit (ExitCode (..))

#if !defined(mingw32_HOST_OS)
import Control.Concurrent.STM.TVar (mkWeakTVar)
import Control.Exception (bracket)
import Data.Foldable (for_, traverse_)
import Data.Traversable (for)
import System.Mem.Weak (deRefWeak)
import System.Posix.Signals (Handler (..), Signal, installHandler, sigINT, sigTERM)
#endif

import Behavior.Internal.Failure (Behavior)
import Behavior.Internal.Runtime (Label (..), atomically)
import Behavior.Internal.Scope

-- | What the @main@ of a program calls: runs the behaviour as a program should be
-- run.
--
-- * It runs in an unbound thread. In the thread of @main@, which is bound, each
--   thread switch would be a system call. (An action that needs a bound thread asks
--   for one with 'Control.Concurrent.runInBoundThread'.)
-- * The first SIGINT (Ctrl-C) or SIGTERM cancels the behaviour. When that has
--   ended, cleanup included, the process ends with 130 or 143. A second signal ends
--   it at once.
--
-- Result, failure and fault are the behaviour's; a fault of its cleanup is thrown
-- instead of the exit. Signals belong to the whole process: run one at a time.
--
-- >>> runBehavior (pure "done")
-- "done"
--
-- @since 0.1.0.0
runBehavior :: Behavior a -> IO a
runBehavior behavior = do
  exit <- newTVarIO Nothing
  handlingSignals exit . structured $ \scope -> do
    program <- branch scope (Label "runBehavior" "program") behavior
    atomically $
      (settle <$> outcome program)
        `orElse` (readTVar exit >>= maybe retry (pure . throwIO . ExitFailure))
 where
#if defined(mingw32_HOST_OS)
  handlingSignals _ = id
#else
  handlingSignals exit act = do
    -- A weak reference: the handlers must not keep the waiting thread reachable,
    -- or GHC would not notice when everything is deadlocked.
    weakly <- mkWeakTVar exit (pure ())
    let end code = do
          for_ signals $ \(signal, _) -> installHandler signal Default Nothing
          deRefWeak weakly >>= traverse_ (\there -> atomically (writeTVar there (Just code)))
        install = for signals $ \(signal, code) ->
          (,) signal <$> installHandler signal (Catch (end code)) Nothing
        restore = traverse_ (\(signal, old) -> installHandler signal old Nothing)
    bracket install restore (const act)
  signals = [(sigINT, 130), (sigTERM, 143)] :: [(Signal, Int)]
#endif
