{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Running a behaviour as a program.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Program.RunBehavior
  ( runBehavior
  ) where

import Control.Concurrent.STM (orElse)
import Control.Exception (throwIO)
import System.Exit (ExitCode (..))

import Behavior.Internal.Concurrent.Scope
import Behavior.Internal.Core.Cause (Cause (..))
import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Program.ProcessSignals (withSignals)
import Behavior.Internal.Seam.Runtime (atomically)

-- | Runs a behaviour as a whole program; to be called by @main@.
--
-- * It runs in an unbound thread. In the thread of @main@, which is bound, operators take ten
--   times as long: each thread switch would be a system call.
-- * The first SIGINT (Ctrl-C), SIGTERM or SIGHUP (a terminal or ssh session was closed)
--   cancels the behaviour. When that has ended, cleanup included, the process ends with 130,
--   143 or 129. A second SIGINT or SIGTERM ends it at once; a SIGHUP does not, because two come when
--   a terminal is closed: it has no effect until the behaviour has ended, and for ten seconds after the
--   first signal it does not end the process. Where SIGHUP is ignored when the behaviour begins
--   (@nohup@), it stays ignored. When the terminal was closed, printing throws an
--   'System.IO.Error.IOError': so a cleanup that first prints, and then stops the motors, never stops them.
-- * While a loop that never allocates runs, GHC runs nothing else, and a signal has no effect. Then a
--   second SIGINT or SIGTERM, two seconds later, ends the process, and prints what the cause may be.
--
-- Result, failure and fault are the behaviour's; a fault of its cleanup is thrown
-- instead of the exit, and so is what is thrown at the caller during the cleanup (by a time limit around this, say):
-- then the program decides whether it goes on. A signal that comes too late to cancel the behaviour has the effect
-- that it had before the run: the handler that was installed then is called, and awaited for at most a second, before
-- this returns. So the first signal always has an effect. But only a handler of the kind
-- 'System.Posix.Signals.Catch' is awaited. Any other (@CatchOnce@, @CatchInfo@, @CatchInfoOnce@, and GHC's own for
-- SIGINT) is called some time later, or not at all if the program has ended by then. (After the
-- behaviour, these signals have the effect that they had before it. If that was the default, a handler of
-- this library does it: so 'System.Posix.Signals.installHandler' returns that handler.)
--
-- Call it in the thread of @main@. In a thread of 'Control.Concurrent.forkIO' the exit code
-- is thrown in that thread: the behaviour is cancelled, and the process goes on. When
-- @main@ returns, the process ends and no cleanup of other threads runs. Signals belong to
-- the whole process: where several behaviours are run so, one inside the other or side by side,
-- a signal cancels all of them. In a process made by @forkProcess@ none of them runs, and
-- no sleep ever ends: call @forkProcess@ before any of this library's operations.
--
-- An action that needs a bound thread can run in 'Control.Concurrent.runInBoundThread', but
-- then it cannot be interrupted: a stop request waits until the action has returned. With
-- @withAsyncBound act wait@ (of the package async) it can be interrupted.
--
-- >>> runBehavior (pure "done")
-- "done"
--
-- @since 0.1.0.0
runBehavior :: Behavior a -> IO a
runBehavior behavior = withSignals $ \signal ->
  structured "runBehavior" $ \scope -> do
    program <- branch scope "program" behavior
    atomically $ (endedBy "program" <$> outcome program) `orElse` (stopped <$> signal)
 where
  stopped (name, code) = Verdict (FromOutside name) (throwIO (ExitFailure code))
