-- |
-- Robots that take orders from one inbox and share a few chargers. Each order is handed over once,
-- whatever happens to the robots: the order of a robot that faults or is withdrawn waits for another
-- one, and its charger is freed.
module Fleet
  ( Fleet (..)
  , Robot (..)
  , Order
  , fleet
  ) where

import Control.Exception (bracket_, displayException, mask)
import Control.Monad (forever, void)

import Behavior
import Behavior.Message
import qualified Behavior.Parallel as Parallel
import Behavior.STM
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Trace (named)

type Order = Int

-- | What the robots share.
data Fleet = Fleet
  { orders :: Inbox Order
  , chargers :: TSem
  , logLine :: String -> Behavior ()
  }

-- | The hardware of one robot. @main@ fills this record with drivers, and a test with a mock.
data Robot = Robot
  { name :: String
  , carry :: Order -> Behavior ()
  , handOver :: Order -> Behavior ()
  -- ^ After it has handed over the order, it must not block.
  , charge :: Behavior ()
  , batteryLow :: Signal Bool
  , withdrawn :: Signal Bool
  -- ^ Becomes true when the human operator takes this robot out of service.
  }

-- | All robots work side by side. A robot that faults or is withdrawn does not stop the others.
-- Fails when no robot is left.
fleet :: Fleet -> [Robot] -> Behavior ()
fleet shared robots = do
  void (Parallel.allOf (map inService robots))
  failWith "no robot is left"
 where
  inService robot = named (name robot) (untilWithdrawn robot) `catchAny` \fault ->
    logLine shared (name robot ++ " is out of service: " ++ displayException fault)
  untilWithdrawn robot =
    Signal.insteadWhen (withdrawn robot) (logLine shared (name robot ++ " is withdrawn")) (work shared robot)

-- | Takes orders and carries them out. An order that is interrupted, by the battery or for good, waits
-- again in its old place, for this robot or another. The drive can be interrupted. The mask keeps an
-- interruption from coming between the hand-over and the end of the order.
work :: Fleet -> Robot -> Behavior ()
work shared robot = Signal.monitor (batteryLow robot) (recharge shared robot) (forever oneOrder)
 where
  oneOrder = mask $ \restore -> handleNext (orders shared) $ \order -> do
    restore (carry robot order)
    handOver robot order
    pure (pure ())

-- | Waits for a free charger, and frees it again, however the charging ends.
recharge :: Fleet -> Robot -> Behavior ()
recharge shared robot =
  bracket_
    (named "wait for a charger" (atomically (waitTSem (chargers shared))))
    (atomically (signalTSem (chargers shared)))
    (charge robot)
