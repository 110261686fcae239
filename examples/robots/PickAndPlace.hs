-- |
-- An arm that takes a part from the table and puts it into a box. Two of three detectors must
-- agree where the part is. A part that slips on the way is picked up again, once. However the
-- work ends, the arm is parked.
module PickAndPlace
  ( Arm (..)
  , Place (..)
  , Grip (..)
  , pickAndPlace
  , locate
  ) where

import Control.Exception (finally)

import Behavior
import qualified Behavior.Parallel as Parallel
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import qualified Behavior.Time as Time
import Behavior.Trace (named)

-- | A position on the table is given in centimetres.
data Place = Above Double | At Double | Box
  deriving (Eq, Show)

data Grip = Open | Closed
  deriving (Eq, Show)

-- | The hardware. @main@ fills this record with drivers, and a test with a mock.
data Arm = Arm
  { detectors :: [Behavior Double]
  -- ^ Each gives the position of the part, and may fail.
  , moveTo :: Place -> Behavior ()
  , gripper :: Grip -> Behavior ()
  , holding :: Signal Bool
  -- ^ Whether there is a part between the fingers of the gripper.
  , park :: Behavior ()
  }

-- | Every move is stopped, cleanup included, before the next step begins, also the move in which
-- the part slips. So the arm never moves while the gripper does.
pickAndPlace :: Arm -> Behavior ()
pickAndPlace arm = (pick >> (carry ? (pick >> carry)) >> gripper arm Open) `finally` parked
 where
  pick = named "pick" $ do
    position <- locate (detectors arm)
    moveTo arm (Above position)
    Time.retrying [0.5, 1] (named "grip" (grip arm position))
  carry = named "carry" (Signal.whileHolding (holding arm) (moveTo arm Box))
  -- A plain @park arm@ would itself be stopped if a cancellation came while it runs. The limit
  -- is for an arm that is stuck.
  parked = Time.cleanupWithin 5 (park arm)

-- | Closes the gripper around the part; fails if there is no part in it then.
grip :: Arm -> Double -> Behavior ()
grip arm position = do
  gripper arm Open
  moveTo arm (At position)
  gripper arm Closed
  Time.timeout 0.5 (Signal.waitUntil (holding arm))

-- | The position on which two detectors agree: at most one centimetre apart. It does not wait for a
-- third one, which may hang.
locate :: [Behavior Double] -> Behavior Double
locate = fmap mean . Parallel.agreeing 2 (\a b -> abs (a - b) <= 1)
 where
  mean positions = sum positions / fromIntegral (length positions)
