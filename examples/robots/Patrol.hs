-- |
-- A robot that patrols. It visits its waypoints for ever, and reports each one. It recharges when
-- its battery is low, looks at a person whom it sees, and then goes on at the waypoint where it
-- was. The red button stops it.
module Patrol
  ( Patrol (..)
  , Waypoint
  , patrol
  ) where

import Control.Exception (finally, mask)
import Control.Monad (forever)

import Behavior
import Behavior.STM
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal

type Waypoint = String

-- | The hardware. @main@ fills this record with drivers, and a test with a mock.
data Patrol = Patrol
  { waypoints :: [Waypoint]
  , driveTo :: Waypoint -> Behavior ()
  , report :: Waypoint -> Behavior ()
  -- ^ Reports that all is well at this waypoint.
  , recharge, investigate, motorsOff :: Behavior ()
  , batteryLow, personSeen, redButton :: Signal Bool
  }

-- | Patrols until the red button is pressed. However it ends, the motors are off.
--
-- The outer condition outranks the inner one: the battery interrupts an investigation, and the
-- button interrupts everything.
patrol :: Patrol -> Behavior ()
patrol robot = do
  ahead <- newTVarIO (waypoints robot)
  untilPressed (Signal.monitor low (recharge robot) (Signal.monitor seen (investigate robot) (rounds robot ahead)))
    `finally` motorsOff robot
 where
  untilPressed = Signal.insteadWhen (redButton robot) (pure ())
  low = batteryLow robot
  seen = personSeen robot

-- | Visits the waypoints that are ahead, then all of them again, and so on. The variable keeps the
-- place: a waypoint stays in it until it has been reported.
rounds :: Patrol -> TVar [Waypoint] -> Behavior ()
rounds robot ahead = forever $ do
  -- The drive can be interrupted. The mask keeps an interruption from coming between the report
  -- and the removal from the list: then the robot would report the same waypoint twice.
  mask $ \restore -> resumable ahead $ \next -> do
    restore (driveTo robot next)
    report robot next
  atomically (writeTVar ahead (waypoints robot))
