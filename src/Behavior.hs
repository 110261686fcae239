-- |
-- A language for the behaviour of robots and other autonomous agents.
--
-- A 'Behavior' is an action that takes time, may fail, and can be interrupted. This
-- module is the language of Biggar and Shames, /A Behavior Tree-inspired programming
-- language for autonomous agents/: ordinary Haskell, and a handful of operators.
--
-- > bt = monitor ((< 10) <$> batteryLevel) recharge (enterRoom >> performTask)
--
-- == Failure, fault, cancellation
--
-- * A /failure/ is an exception under 'BehaviorFailed': the robot could not do its task.
--   '?' and the operators derived from it catch exactly these exceptions.
-- * A /fault/ is any other synchronous exception: a bug, a lost connection. No
--   operator swallows one.
-- * A /cancellation/ is an asynchronous exception: the behaviour is to stop early. No
--   operator swallows one.
--
-- == What every operator promises
--
-- 1. /Structured./ When an operator returns or throws, every behaviour that it started has
--    ended, cleanup included. No behaviour is orphaned, even if the caller is interrupted twice
--    meanwhile. (So a slow cleanup makes the caller wait.)
-- 2. /Never both./ 'rSelect' and 'monitor' start a branch only after the previous one,
--    cleanup included, has ended.
-- 3. /No lost work./ If an operator's own branch returns although its stop was requested, it
--    has completed: its result stands, and that operator does not run it again. (If an outer
--    operator interrupts this one after the branch has completed, and before this operator
--    has returned, the result is lost.)
-- 4. /No lost fault./ A fault of a branch, also one thrown while the branch is being
--    stopped, always reaches the caller. (Of several, the leftmost.)
-- 5. /Interruptible./ What runs in a thread of its own runs unmasked, whatever the caller's
--    masking state. (That is every branch, and the recovery of 'monitor'.) '?', 'attempt' and
--    'fallbackOver' keep the caller's masking state.
-- 6. /Together./ An operator first requests the stop of everything that has to stop, and
--    then waits.
-- 7. /Constant space./ A million reselections, recoveries, retries or alternatives
--    (nested to the right) run in constant memory.
-- 8. /Labelled./ Every thread is labelled with its operator and branch. (Before GHC 9.6 only an
--    event log shows labels: there a thread has one only while an event log is written.)
-- 9. /A dead sensor is never \"false\"./ A condition that fails, faults or no longer has a
--    value ends its operator with a failure or fault, after the branch has stopped.
-- 10. /Nothing spins./ An operator that waits uses no processor time. Readings of one
--     polled condition by one operator, rereads included, have slots that are at least one
--     period apart; each slot has at most one reading.
--
-- == Which outcome, when several things happened
--
-- An operator asks in this order; the first yes decides:
--
-- 1. Was an exception, of whatever type, thrown at the caller from outside? (As by
--    @throwTo main (ExitFailure 3)@ in a signal handler.) Every branch is stopped, and the
--    same exception is thrown; if a branch faulted as well, 'StoppedWithFault' carries both.
-- 2. Did a branch fault? (The leftmost.)
-- 3. Did a branch complete or fail? (On a tie the left one.)
-- 4. Did a sensor fail?
-- 5. Did the condition change?
--
-- '?', 'attempt', 'failingOn' and your own handlers run in the caller's thread and decide by
-- the exception's type: an exception that is thrown there from outside counts as a failure
-- if its type is that of a failure. When GHC detects that the operator and its branches wait
-- for each other (a deadlock), a branch's fault comes first.
--
-- == Work that must survive nested interruptions
--
-- The following delivers twice if the battery falls low while the phone is slow to stop: the
-- delivery has completed, but the outer 'monitor' interrupts 'Behavior.Parallel.firstOf'
-- before that returns.
--
-- > monitor low charge (whileHolding ok (firstOf [deliver, phone]))
--
-- To avoid that, the branch records that it has completed, and reads the record when it is
-- run again:
--
-- > done <- newTVarIO False
-- > let once = atomically (readTVar done) >>= \is -> unless is (deliver >> atomically (writeTVar done True))
-- > monitor low charge (whileHolding ok (firstOf [once, phone]))
--
-- No interruption may come between the last step of @deliver@ and the record of it: put both
-- under one 'Control.Exception.mask_'.
--
-- == Cleanups that take time
--
-- @finally@, @bracket@ and @onException@ run a cleanup masked. Still, a stop request can
-- interrupt a blocking operation in it ('sleep', a transaction that retries), if the
-- behaviour had ended by itself and was already cleaning up when its stop was requested. The
-- rest of the cleanup is then skipped, and the recovery starts. If a cleanup must run to its end,
-- make it uninterruptible, or better, give it a limit ('Behavior.Time.cleanupWithin'); the operator
-- that stops the behaviour waits for it:
--
-- > (extend arm >> takePicture) `finally` cleanupWithin 3 (park arm)
--
-- A behaviour that may hang where nothing can interrupt it, so that its operator would wait for ever,
-- can be abandoned: 'Behavior.Time.abandoning' is the only way out of promises 1, 2 and 4. (One other thing can
-- outlive what started it, and it runs no behaviour: a sink that is blocked at the end of its trace, see
-- "Behavior.Trace".)
--
-- == What GHC limits
--
-- An operator waits for the cleanups of its branches. Meanwhile it receives the first
-- exception that is thrown at its caller; later ones stay pending, as in a thread that cannot
-- be interrupted. So a cleanup may itself throw to the operator's caller, once:
--
-- > parallel drive (steer `finally` throwTo me EmergencyStop)
--
-- A second such @throwTo@ never returns. Neither does one to a caller that is masked or has already
-- been stopped (as the caller of a nested operator is when the outer operator has been stopped):
-- @throwTo@ waits for the caller, and the caller waits for the cleanup. (A simulation ends
-- there, and names both threads.) Let a separate thread throw the exception:
--
-- > parallel drive (steer `finally` forkIO (throwTo me EmergencyStop))
--
-- A behaviour that never reaches a point where it can be interrupted does not stop: a loop
-- that never allocates (compile with @-fno-omit-yields -fno-full-laziness@: the page
-- @docs\/interruption.md@ says why), a safe foreign call (import it @interruptible@). A behaviour
-- cannot rely on recovering from 'Control.Exception.BlockedIndefinitelyOnMVar' and similar
-- exceptions, because GHC throws them to the operator that waits for the behaviour, too. An operator
-- does not belong in a lazy value ('System.IO.Unsafe.unsafeInterleaveIO'): if it is stopped while that
-- is evaluated, GHC keeps the stop request in the value, and throws it to the thread that evaluates it later.
module Behavior
  ( -- * Behaviours
    Behavior
  , runBehavior
  , sleep
  , Seconds

    -- * What to do when something fails
  , fallback
  , (?)
  , fallbackWith
  , fallbackOver
  , attempt

    -- * Doing two things at once
  , parallel
  , (|||)
  , both

    -- * Reacting while something runs
  , rSelect
  , monitor

    -- * Going on where it was interrupted
  , resumable
  , resumableFor

    -- * Failing
  , failed
  , failWith
  , failingOn
  , Failed (..)
  , BehaviorFailed (..)
  , failurePath
  , behaviorFailedToException
  , behaviorFailedFromException

    -- * What to do about a fault
  , tryAny
  , catchAny

    -- * Faults met while stopping
  , StoppedWithFault (..)
  ) where

import Behavior.Internal.Concurrent.Parallel
import Behavior.Internal.Concurrent.Resumable
import Behavior.Internal.Core.Failure
import Behavior.Internal.Program.RunBehavior
import Behavior.Internal.Reactive.Polled
import Behavior.Internal.Seam.Runtime
