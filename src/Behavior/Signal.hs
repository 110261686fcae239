-- |
-- What can be watched, and the reactive operators on it. Import it qualified:
--
-- > import Behavior
-- > import Behavior.Signal (Signal)
-- > import qualified Behavior.Signal as Signal
-- >
-- > guarded :: Signal Int -> Behavior a -> Behavior a
-- > guarded battery = Signal.monitor ((< 10) <$> battery) recharge
--
-- The paper's 'Behavior.monitor' and 'Behavior.rSelect' poll their condition; these
-- react to whatever kind of signal they are given, and cost nothing while a signal
-- that is 'watching' a transaction does not change.
module Behavior.Signal
  ( -- * What can be watched
    Signal
  , watching
  , polling

    -- ** More exactly
  , staleAfter
  , debounce
  , hysteresis

    -- ** By several at once
  , withShared

    -- * What to do meanwhile

    -- ** Interrupting
  , rSelect
  , monitor

    -- ** Many branches
  , switch
  , teleoReactive

    -- ** Waiting for a condition, and holding to one
  , waitUntil
  , whileHolding
  ) where

import Behavior.Internal.Reactive.Operators
import Behavior.Internal.Signal.Filter
import Behavior.Internal.Signal.Polling
import Behavior.Internal.Signal.Shared
import Behavior.Internal.Signal.Source
