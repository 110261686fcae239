-- |
-- The arm that picks and places, on its worst day: the part slips while the arm is being stopped.
module Examples.PickAndPlaceSpec (spec) where

import Control.Exception (finally)
import Control.Monad (when)
import Data.Foldable (for_)
import Test.Hspec

import Behavior
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Sim.Mock
import qualified Behavior.Time as Time
import Examples.WorstDay
import PickAndPlace
import Support (guarded)

spec :: Spec
spec = guarded $ do
  it "picks up a part that has slipped, and puts it into the box" $
    inOneRun (day [3] 60 (exactly 2 (startOf "move to Box") <> exactly 1 (successOf "move to Box")) pickAndPlace)
  it "gives up when the part has slipped twice" $
    inOneRun (day [3, 7] 60 (exactly 2 (startOf "move to Box") <> never (successOf "move to Box")) pickAndPlace)
  it "takes a position on which two of three detectors agree" $ do
    let located found =
          fmap ended . simulate $ locate found >>= \position -> when (position /= 2.5) (failWith (show position))
    located [pure 2, Time.sleep 1 >> pure 3, Time.sleep 3600 >> pure 2] `shouldReturn` "returned"
    located [pure 7, failWith "dark", pure 2] `shouldReturn` "failure: FailedBecause \"no 2 of 3 agree\""
  it "never moves while the gripper moves, and ends parked, whenever it is cancelled" $
    for_ moments $ \moment ->
      survives 30 (day [3, 7] moment mempty pickAndPlace)
  it "and an arm whose parking can be stopped does not" $
    failsWith "exactly once \"park\" is done" 50 . day [3, 7] 7.75 mempty $ \arm ->
      pickAndPlace arm {park = pure ()} `finally` park arm
  it "and an arm that reacts to a slip in another branch, before it has stopped, does not" $
    failsWith "never \"gripper\" is running while \"move to\" is running" 50 (day [1] 60 mempty reactingBeside)
 where
  -- In the middle of each step, and when the part slips, the arm stops or parks.
  moments = [0.25, 0.75, 1.125, 1.5, 1.875, 2, 2.5, 3, 3.25, 3.5, 4.25, 5.5, 6, 7, 7.25, 7.5, 7.75]
  reactingBeside arm = (grab arm >> (moveTo arm Box ||| regrab arm) >> gripper arm Open) `finally` park arm
  regrab arm = Signal.waitUntil (not <$> holding arm) >> grab arm
  grab arm = gripper arm Open >> gripper arm Closed >> Signal.waitUntil (holding arm)

-- | The part slips at the given times, if it is held then; and the arm is cancelled at the given
-- time.
day :: [Seconds] -> Seconds -> Claim -> (Arm -> Behavior ()) -> Day
day slips cancelledAt claim robot simulated = do
  world <- newMock
  held <- condition world "holding" ((0, False) : [(t, False) | t <- slips])
  move <- actionOn world "move to" $ \place -> [succeeds `taking` (if place == Box then 2 else 0.5) `slowToStop` 0.5]
  grips <- actionOn world "gripper" $ \to ->
    [succeeds `taking` 0.25 `causing` set held (to == Closed) `slowToStop` 0.125]
  parks <- action world "park" [succeeds `taking` 1]
  first <- action world "camera" [returning 2]
  third <- action world "laser" [returning 2.5 `taking` 0.5]
  run <-
    simulated . (? pure ()) . Time.timeout cancelledAt . robot $
      Arm
        { detectors = [first, failWith "no echo", third]
        , moveTo = move
        , gripper = grips
        , holding = signal held
        , park = parks
        }
  well run
  world `shouldRecord` never (running "gripper" `overlapping` running "move to")
  world `shouldRecord` never (running "park" `overlapping` running "move to")
  world `shouldRecord` never (running "park" `overlapping` running "gripper")
  world `shouldRecord` exactly 1 (startOf "park") <> exactly 1 (successOf "park")
  world `shouldRecord` whenever (startOf "park") (never (anyOf [startOf "move to", startOf "gripper"]))
  world `shouldRecord` claim
