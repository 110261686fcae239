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
import qualified Behavior.Time as Time

type Waypoint = String

-- | The hardware. @main@ fills this record with drivers, and a test with a mock.
data Patrol = Patrol
  { waypoints :: [Waypoint]
  -- ^ At least one.
  , driveTo :: Waypoint -> Behavior ()
  , report :: Waypoint -> Behavior ()
  -- ^ Reports that all is well at this waypoint. After it has sent the report, it must not block.
  , recharge, investigate, motorsOff :: Behavior ()
  , batteryLow, personSeen, redButton :: Signal Bool
  }

-- | Patrols until the red button is pressed. However it ends, the motors are off. (A cancellation
-- would interrupt a plain @motorsOff robot@ that has to wait for its driver.)
--
-- The rules are in the order of their rank: the battery interrupts an investigation, and the button
-- interrupts everything.
patrol :: Patrol -> Behavior ()
patrol robot = do
  ahead <- newTVarIO (waypoints robot)
  let withRules =
        Signal.insteadWhen (redButton robot) (pure ())
          . Signal.monitor (batteryLow robot) (recharge robot)
          . Signal.monitor (personSeen robot) (investigate robot)
  withRules (rounds robot ahead) `finally` Time.cleanupWithin 1 (motorsOff robot)

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
