-- |
-- The paper's mission once more, with names for what a picture shows. (The actions of the mock world
-- have names already.)
module Named
  ( bt
  ) where

import Behavior
import qualified Behavior.Signal as Signal
import Behavior.Trace (named)
import Robot hiding (batteryLow)

bt :: Behavior ()
bt = Signal.monitor batteryLow recharge (named "enter room" enterRoom >> doTask)
 where
  batteryLow = Signal.named "battery low" ((< 10) <$> Signal.named "battery" (Signal.polling 0.01 batteryLevel))

enterRoom :: Behavior ()
enterRoom =
  (open frontDoor >> passThrough frontDoor >> close frontDoor)
    ? ((open backDoor ? smash backDoor) >> passThrough backDoor)
