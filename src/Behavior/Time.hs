-- |
-- Time: the clock, sleeping, trying again, doing something periodically, and time limits.
--
-- Durations are 'Seconds', written as literals.
--
-- >>> timeout 0.5 (sleep 0.001 >> pure "in time")
-- "in time"
module Behavior.Time
  ( -- * The clock
    Seconds
  , now

    -- * Waiting
  , sleep
  , sleepUntil
  , sleepForever
  , checkpoint

    -- * Again
  , retrying
  , retryingWith
  , every

    -- * Limits
  , timeout
  , timeoutAt
  , TimedOut (..)
  , cleanupWithin

    -- * Going on without a behaviour that does not stop
  , abandoning
  , abandonedCount
  , Abandoned (..)
  ) where

import Behavior.Internal.Concurrent.Abandoning
import Behavior.Internal.Concurrent.Repeating
import Behavior.Internal.Reactive.Timeout
import Behavior.Internal.Seam.Runtime
