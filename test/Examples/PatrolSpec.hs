-- |
-- The robot that patrols, on its worst day: its battery becomes low just when it arrives.
module Examples.PatrolSpec (spec) where

import Control.Exception (uninterruptibleMask_)
import Control.Monad (forever)
import Data.Foldable (for_)
import Test.Hspec

import Behavior
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Sim (well)
import Behavior.Sim.Mock
import Behavior.Time (checkpoint, timeout)
import Examples.WorstDay
import Patrol
import Support (guarded)

spec :: Spec
spec = guarded $ do
  it "reports each waypoint once in each round, although the battery becomes low as it arrives" $
    survives 300 (worstDay 16 patrol)
  it "and a robot that can be interrupted between its report and the next waypoint does not" $
    failsWith "\"report" 300 . worstDay 6 . interrupted $ \robot ahead ->
      resumable ahead (visit robot) >> atomically (writeTVar ahead (waypoints robot))
  it "and a robot that begins its round again after charging does not" $
    failsWith "\"report" 50 . worstDay 6 . interrupted $ \robot _ ->
      for_ (waypoints robot) (visit robot)
 where
  visit robot place = driveTo robot place >> report robot place
  interrupted aRound robot = do
    ahead <- newTVarIO (waypoints robot)
    Signal.insteadWhen (redButton robot) (uninterruptibleMask_ (motorsOff robot)) $
      Signal.monitor (batteryLow robot) (recharge robot) (forever (aRound robot ahead))

-- | The battery becomes low each time when the robot arrives somewhere; once it sees a person in the
-- same instant. At last the red button is pressed, just when it arrives; and while the motors are
-- switched off, the robot is cancelled.
worstDay :: Seconds -> (Patrol -> Behavior ()) -> Day
worstDay pressedAt robot simulated = do
  world <- newMock
  low <- condition world "battery low" [(0, False), (2, True), (5, True), (8, True)]
  seen <- condition world "person seen" [(0, False), (8, True)]
  button <- condition world "red button" [(0, False), (pressedAt, True)]
  drive <- actionOn world "drive to" (const [succeeds `taking` 2])
  reports <- actionOn world "report" (const [succeeds])
  charge <- action world "recharge" [succeeds `taking` 1 `causing` set low False]
  look <- action world "investigate" [succeeds `taking` 1 `causing` set seen False]
  off <- action world "motors off" [succeeds `taking` 0.5]
  run <-
    simulated . (? pure ()) . timeout (pressedAt + 0.25) . robot $
      Patrol
        { waypoints = places
        , driveTo = drive
        , -- The driver returns a moment after it has sent the report.
          report = \place -> reports place >> checkpoint
        , recharge = charge
        , investigate = look
        , motorsOff = off
        , batteryLow = signal low
        , personSeen = signal seen
        , redButton = signal button
        }
  well run
  world `shouldRecord` inOrder <> eventually (successOf (reportOf (if pressedAt > 10 then "C" else "A")))
  world `shouldRecord` whenever (becoming "battery low" True) (withinSeconds 0 (startOf "recharge"))
  world `shouldRecord` never (running "drive to" `overlapping` running "recharge")
  world `shouldRecord` never (running "drive to" `overlapping` running "investigate")
  world `shouldRecord` whenever (becoming "red button" True) (withinSeconds 0.5 (successOf "motors off"))
  world `shouldRecord` exactly 1 (startOf "motors off") <> whenever (startOf "motors off") (never (startOf "drive to"))

places :: [Waypoint]
places = ["A", "B", "C"]

-- | No waypoint is skipped; and after its report the robot does not drive to a waypoint before it
-- has reported the next one.
inOrder :: Claim
inOrder =
  foldMap (comesBefore (successOf (reportOf "A")) . successOf . reportOf) ["B", "C"]
    <> foldMap next (zip places (drop 1 (cycle places)))
 where
  next (this, following) =
    whenever (successOf (reportOf this)) $
      foldMap (comesBefore (successOf (reportOf following)) . successOf . reportOf) (filter (/= following) places)
        <> successOf (reportOf following) `comesBefore` startOf ("drive to " ++ show this)

reportOf :: Waypoint -> String
reportOf place = "report " ++ show place
