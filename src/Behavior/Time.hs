-- |
-- Time: the clock, sleeping, and time limits.
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
  , atomically
  , checkpoint

    -- * Limits
  , timeout
  , TimedOut (..)
  ) where

import Behavior.Internal.Reactive.Timeout
import Behavior.Internal.Runtime
