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
-- * A /failure/ is an exception under 'BehaviorFailed': the robot could not do it.
--   '?' and all that derives from it catch exactly this.
-- * A /fault/ is any other synchronous exception: a bug, a lost connection. No
--   operator swallows one.
-- * A /cancellation/ is an asynchronous exception: somebody no longer wants this
--   behaviour. No operator swallows one.
--
-- == What every operator promises
--
-- 1. /Structured./ When it returns or throws, every behaviour that it started has
--    ended, cleanup included, even if the caller was interrupted twice meanwhile.
--    (So a slow cleanup makes the caller wait.)
-- 2. /Never both./ 'rSelect' and 'monitor' start a branch only after the one before,
--    cleanup included, has ended.
-- 3. /No lost work./ An operator's own branch that was asked to stop and returned all the
--    same has completed: its result stands, and that operator does not run it again. (An
--    outer operator that interrupts this one between its branch's completion and its return
--    loses the result: see below.)
-- 4. /No lost fault./ A fault of a branch, also while it is being stopped, always
--    gets out.
-- 5. /Interruptible./ What runs in a thread of its own (every branch, and
--    the recovery of 'monitor') runs unmasked, whatever the caller's masking state. '?',
--    'attempt' and 'fallbackOver' keep the caller's.
-- 6. /Together./ What has to stop is asked all at once, then waited for.
-- 7. /Constant space./ A million reselections, recoveries, retries or alternatives
--    (nested to the right) run in constant memory.
-- 8. /Labelled./ Every thread is labelled with its operator and branch.
-- 9. /A dead sensor is never \"false\"./ A condition that fails or faults, or has no
--    value any more, fails its operator, after the branch has stopped.
-- 10. /Nothing spins./ An operator that waits uses no processor time; readings of one
--     polled condition by one operator, rereads included, have slots a period apart, and
--     each slot has at most one.
--
-- == Which outcome, when several things happened
--
-- An operator asks, in this order:
--
-- 1. Was something thrown at the caller from outside, of whatever type? (As by
--    @throwTo main (ExitFailure 3)@ in a signal handler.) Every branch is stopped, and the
--    same exception is thrown; if a branch faulted as well, 'StoppedWithFault' carries both.
-- 2. Did a branch fault? (The leftmost.)
-- 3. Did a branch complete or fail? (On a tie the left one.)
-- 4. Did a sensor fail?
-- 5. Did the condition change?
--
-- '?', 'attempt', 'failingOn' and handlers of your own run in the caller's thread and go by
-- type: what is thrown there from outside, and is a failure by its type, is a failure to them.
-- When GHC finds that all wait for each other, a branch's fault comes first.
--
-- == Work that must survive nested interruptions
--
-- Delivers twice, when the battery falls low while the phone is slow to stop: the delivery
-- completed, but the outer 'monitor' interrupted 'Behavior.Parallel.firstOf' before that returned.
--
-- > monitor low charge (whileHolding ok (firstOf [deliver, phone]))
--
-- The branch itself records that it completed, and looks at that when it is run again:
--
-- > done <- newTVarIO False
-- > let once = atomically (readTVar done) >>= \is -> unless is (deliver >> atomically (writeTVar done True))
-- > monitor low charge (whileHolding ok (firstOf [once, phone]))
--
-- What must not be cut in two, the last step of @deliver@ and the record of it, is put under one
-- 'Control.Exception.mask_'.
--
-- == Cleanups that take time
--
-- @finally@, @bracket@ and @onException@ run a cleanup masked. What waits in it ('sleep', a transaction
-- that retries) can be interrupted all the same: by a stop request, when the behaviour had ended by
-- itself and was cleaning up already. The rest of the cleanup is then skipped, and the recovery
-- starts. A cleanup that must be finished is made uninterruptible; whatever stops it waits:
--
-- > (extend arm >> takePicture) `finally` uninterruptibleMask_ (park arm)
--
-- == What GHC limits
--
-- An operator waits for the cleanups of its branches, and what is thrown at its caller meanwhile is
-- first received, then pending, as in a thread that cannot be interrupted. So a cleanup may throw to
-- the operator's caller itself, once:
--
-- > parallel drive (steer `finally` throwTo me EmergencyStop)
--
-- A second exception, or one for a caller that is masked or has been stopped already (as the caller
-- of a nested operator has, whose outer one was stopped), hangs: @throwTo@ waits for the caller, and
-- that for the cleanup. (A simulation ends there, and names both.) Have a thread of its own throw it:
--
-- > parallel drive (steer `finally` forkIO (throwTo me EmergencyStop))
--
-- A behaviour that never reaches a point where it could be interrupted is not: a loop that
-- never allocates (compile it with @-fno-omit-yields@), a safe foreign call (import it
-- @interruptible@). A behaviour cannot count on recovering from
-- 'Control.Exception.BlockedIndefinitelyOnMVar' and its like, since GHC throws that to the
-- operator that waits for it too.
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

    -- * Failing
  , failed
  , failWith
  , failingOn
  , Failed (..)
  , BehaviorFailed (..)
  , behaviorFailedToException
  , behaviorFailedFromException

    -- * What to do about a fault
  , tryAny
  , catchAny

    -- * Faults met while stopping
  , StoppedWithFault (..)
  ) where

import Behavior.Internal.Failure
import Behavior.Internal.Parallel
import Behavior.Internal.Program
import Behavior.Internal.Reactive.Polled
import Behavior.Internal.Runtime
