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
-- 3. /No lost work./ A branch that was asked to stop and returned all the same has
--    completed: its result stands, and it is not run again.
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
-- 10. /Nothing spins./ An operator that waits uses no processor time; readings of
--     one condition by one operator start at least a period apart.
--
-- == Which outcome, when several things happened
--
-- An operator asks, in this order: Was the caller cancelled? (If a branch faulted as
-- well, 'StoppedWithFault' carries both.) Did a branch fault? (The leftmost.) Did a
-- branch complete or fail? (On a tie the left one.) Did a sensor fail? Did the
-- condition change?
--
-- Two limits are GHC's. What never reaches a point where it could be interrupted is
-- not: a loop that never allocates (compile it with @-fno-omit-yields@), a safe
-- foreign call (import it @interruptible@). And a behaviour can not count on
-- recovering from 'Control.Exception.BlockedIndefinitelyOnMVar' and its like, since
-- whoever waits for it is told of the deadlock too.
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
import Behavior.Internal.Polled
import Behavior.Internal.Program
import Behavior.Internal.Runtime
import Behavior.Internal.Scope
