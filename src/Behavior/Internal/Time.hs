{-# LANGUAGE CPP #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Limits of time, and the life of a program.
module Behavior.Internal.Time
  ( timeout
  , TimedOut (..)
  , runBehavior
  ) where

import Control.Concurrent.STM (newTVarIO, orElse, readTVar, retry, writeTVar)
import Control.Exception (Exception (..), throwIO)
import System.Exit (ExitCode (..))

#if !defined(mingw32_HOST_OS)
import Control.Concurrent.STM.TVar (mkWeakTVar)
import Control.Exception (bracket)
import Data.Foldable (for_, traverse_)
import Data.Traversable (for)
import System.Mem.Weak (deRefWeak)
import System.Posix.Signals (Handler (..), Signal, installHandler, sigINT, sigTERM)
#endif

import Behavior.Internal.Failure
  ( Behavior
  , behaviorFailedFromException
  , behaviorFailedToException
  )
import Behavior.Internal.Reactive (Reaction (..), react)
import Behavior.Internal.Runtime (Label (..), Seconds, atomically, duration)
import Behavior.Internal.Scope
import Behavior.Internal.Source (elapsed)

-- $setup
-- >>> import Behavior (sleep, (?))

-- | Runs the behaviour for at most so many seconds, and fails with 'TimedOut' when
-- it takes longer.
--
-- [Result] The behaviour's; one that is there when time is up, or that the
--   behaviour returns although it was asked to stop, is kept.
-- [Failure] 'TimedOut', or the behaviour's own.
-- [Fault] Of the behaviour, also while it is being stopped: thrown.
-- [Cancellation] The behaviour is asked to stop; it returns after that has ended.
--
-- With zero seconds the behaviour is not started. A negative number or NaN is
-- refused with an 'Control.Exception.ErrorCall' (a fault); an infinite one is no limit.
--
-- It returns when the behaviour has ended, cleanup included; so a slow cleanup
-- makes it late.
--
-- >>> timeout 0.01 (sleep 3600)
-- *** Exception: TimedOut 0.01
--
-- >>> timeout 0.01 (sleep 3600) ? putStrLn "never mind"
-- never mind
--
-- @since 0.1.0.0
timeout :: Seconds -> Behavior a -> Behavior a
timeout seconds behavior = do
  limit <- duration "timeout" seconds
  react "timeout" (elapsed limit) $ \case
    True -> Conclude (throwIO (TimedOut limit))
    False -> Run "branch" behavior

-- | The failure of a behaviour that took longer than so many seconds.
--
-- @since 0.1.0.0
newtype TimedOut = TimedOut Seconds
  deriving (Eq, Show)

instance Exception TimedOut where
  toException = behaviorFailedToException
  fromException = behaviorFailedFromException
  displayException (TimedOut limit) = "timed out after " ++ show limit ++ " s"

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
