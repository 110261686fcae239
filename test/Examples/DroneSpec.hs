-- |
-- The drone, on its worst day: strong wind, a low battery, the end of its time and a camera driver
-- that faults while it stops, all at once.
module Examples.DroneSpec (spec) where

import Control.Exception (finally)
import Data.Foldable (for_)
import Test.Hspec

import Behavior
import qualified Behavior.Signal as Signal
import Behavior.Sim.Mock
import qualified Behavior.Time as Time
import Drone
import Examples.WorstDay
import Support (guarded)

spec :: Spec
spec = guarded $ do
  it "flies along a new path as soon as that is ready, and not earlier" $
    inOneRun . day calm "returned" drone $
      successOf "next path" `comesBefore` interruptionOf "fly to \"row 2\""
        <> exactly 1 (interruptionOf "fly to")
        <> successOf "next path" `comesBefore` startOf "fly to \"row 9\""
        <> successOf "fly to \"row 9\"" `comesBefore` startOf "fly to \"home\""
        <> successOf "fly to \"home\"" `comesBefore` startOf "land"
  it "flies home when the battery is low, and when its time is up" $
    for_ [calm {lowAt = 6}, calm {limit = 6}] $ \setting ->
      inOneRun . day setting "returned" drone $
        never (successOf "fly to \"row 9\"") <> successOf "fly to \"home\"" `comesBefore` startOf "land"
  it "lands once, and switches its motors off after that, on its worst day" $ do
    survives 300 (day worst "fault: the driver has crashed" drone mempty)
    for_ [0.5, 1, 4, 4.25, 8.5, 10, 10.5, 11.5] $ \moment ->
      survives 50 (day calm {windAt = moment, lowAt = moment} "returned" drone mempty)
  it "lands once when it is cancelled, at any time" $
    for_ [0.5, 1, 4, 4.25, 8.5, 10, 10.5, 11.5] $ \moment ->
      survives 50 (day calm {cancelledAt = moment} "returned" drone mempty)
  it "and a drone for which landing is an emergency does not" $
    failsWith "exactly once \"land\" begins" 50 (day calm {windAt = 11.5} "returned" landingInFlight mempty)
  it "and a drone whose landing can be stopped does not" $
    failsWith "\"land\" is done" 50 (day calm {cancelledAt = 11.5} "returned" stoppable mempty)
  it "and a drone that lands only after a flight without faults does not" $
    failsWith "\"land\"" 50 (day worst "fault: the driver has crashed" landingAfterwards mempty)
 where
  worst = calm {windAt = 7, lowAt = 7, limit = 6, crashes = True}
  landingInFlight robot =
    (motorsOn robot >> Signal.insteadWhen (strongWind robot) (land robot) (flight robot >> land robot))
      `finally` motorsOff robot
  stoppable robot = (motorsOn robot >> flight robot) `finally` (land robot >> motorsOff robot)
  landingAfterwards robot = do
    motorsOn robot
    (Signal.insteadWhen (strongWind robot) (pure ()) (flight robot) >> land robot) `finally` motorsOff robot
  flight robot = do
    takeOff robot
    Signal.insteadWhen (batteryLow robot) (pure ()) (Time.timeout (timeLimit robot) (survey robot) ? pure ())
    flyTo robot (home robot)

-- | What happens when, in seconds.
data Setting = Setting
  { windAt, lowAt, limit, cancelledAt :: Seconds
  , crashes :: Bool
  }

-- | The survey ends after 8.5 seconds, the drone is home after 10.5, and it has landed after 12.5.
calm :: Setting
calm = Setting {windAt = 900, lowAt = 900, limit = 900, cancelledAt = 900, crashes = False}

day :: Setting -> String -> (Drone -> Behavior ()) -> Claim -> Day
day setting end robot claim simulated = do
  world <- newMock
  windy <- condition world "strong wind" [(0, False), (windAt setting, True)]
  low <- condition world "battery low" [(0, False), (lowAt setting, True)]
  on <- action world "motors on" [succeeds]
  off <- action world "motors off" [succeeds]
  up <- action world "take off" [succeeds `taking` 1 `slowToStop` 0.5]
  down <- action world "land" [succeeds `taking` 2]
  fly <- actionOn world "fly to" (const [succeeds `taking` 2 `slowToStop` 0.5])
  camera <- action world "film" [(if crashes setting then (`faultsStopping` "the driver has crashed") else id) hangs]
  plan <- action world "next path" [returning ["row 8", "row 9"] `taking` 3, hangs]
  run <-
    simulated . (? pure ()) . Time.timeout (cancelledAt setting) . robot $
      Drone
        { motorsOn = on
        , takeOff = up
        , land = down
        , motorsOff = off
        , flyTo = fly
        , home = "home"
        , film = camera
        , firstPath = ["row 1", "row 2", "row 3", "row 4"]
        , nextPath = plan
        , timeLimit = limit setting
        , strongWind = signal windy
        , batteryLow = signal low
        , logLine = const (pure ())
        }
  ended run `shouldBe` end
  world `shouldRecord` exactly 1 (startOf "land") <> exactly 1 (successOf "land") <> exactly 1 (startOf "motors off")
  world `shouldRecord` successOf "land" `comesBefore` startOf "motors off"
  world
    `shouldRecord` whenever (startOf "land") (never (anyOf (map startOf ["fly to", "film", "next path", "take off"])))
  world
    `shouldRecord` never (running "land" `overlapping` running "fly to")
      <> never (running "land" `overlapping` running "film")
  world `shouldRecord` claim
