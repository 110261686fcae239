-- |
-- Signals, which can be watched, and the reactive operators on them. Import it qualified:
--
-- > import Behavior
-- > import Behavior.Signal (Signal)
-- > import qualified Behavior.Signal as Signal
-- >
-- > guarded :: Signal Int -> Behavior a -> Behavior a
-- > guarded battery = Signal.monitor ((< 10) <$> battery) recharge
--
-- The paper's 'Behavior.monitor' and 'Behavior.rSelect' poll their condition. The operators of
-- this module react to every kind of signal; while a signal that is 'watching' a transaction
-- does not change, they cost nothing.
module Behavior.Signal
  ( -- * Signals
    Signal
  , watching
  , polling

    -- ** Filtering
  , debounce
  , throttle
  , hysteresis
  , changes

    -- ** Detecting stale readings
  , staleAfter
  , olderThan

    -- ** Naming
  , named
  , namedWith

    -- ** Sharing between operators
  , withShared

    -- * Reactive operators

    -- ** Interrupting
  , rSelect
  , monitor
  , insteadWhen

    -- ** Pausing
  , pausedWhile
  , stoppedWhile

    -- ** Many branches
  , switch
  , teleoReactive

    -- ** Reading, waiting for a condition, and requiring one
  , read
  , waitUntil
  , waitUntilJust
  , whileHolding
  ) where

import Prelude ()

import Behavior.Internal.Reactive.Operators
import Behavior.Internal.Reactive.Pausing
import Behavior.Internal.Signal.Filter
import Behavior.Internal.Signal.Polling
import Behavior.Internal.Signal.Shared
import Behavior.Internal.Signal.Source
