-- |
-- The listings of Sections 3 to 5: the robot's actions, step by step. (The listings that
-- contradict the paper's text are in "Paper.ErrataSpec".)
module Paper.ListingsSpec (spec) where

import Control.Exception (throwIO)
import Data.Foldable (for_)
import Test.Hspec

import Behavior
import qualified Paper.Battery as Battery
import qualified Paper.Bind as Bind
import qualified Paper.BindDo as BindDo
import qualified Paper.BindLambda as BindLambda
import qualified Paper.Chattering as Chattering
import qualified Paper.Circle as Circle
import qualified Paper.DangerNearby as DangerNearby
import qualified Paper.FallbackByCatch as FallbackByCatch
import qualified Paper.FallbackInfix as FallbackInfix
import qualified Paper.FindBox as FindBox
import qualified Paper.FindBoxDo as FindBoxDo
import qualified Paper.FindBoxLambda as FindBoxLambda
import qualified Paper.IfNot as IfNot
import qualified Paper.InsideRoom as InsideRoom
import qualified Paper.MonitorBattery as MonitorBattery
import qualified Paper.NestedSelection as NestedSelection
import qualified Paper.PassDoor as PassDoor
import qualified Paper.SequenceAsSelection as SequenceAsSelection
import Paper.Stage
import qualified Paper.Then as Then
import qualified Paper.ThenBind as ThenBind
import qualified Paper.ThenDo as ThenDo
import qualified Paper.Threshold as Threshold
import qualified Paper.Unless as Unless
import qualified Paper.Wall as Wall
import Support (Ending (..), Fault (..), ending, guarded, hang)
import World

spec :: Spec
spec = guarded $ do
  reactiveSelection
  whenReactive
  preempting
  oneSided
  withData
  conditions
  specification

reactiveSelection :: Spec
reactiveSelection = do
  describe "Paper.NestedSelection" $ do
    for_ [(one, two, three) | one <- [False, True], two <- [False, True], three <- [False, True]] $
      \(one, two, three) -> do
        let chosen
              | one = if three then "a5" else "a4"
              | otherwise = if two then "a2" else "a1"
        it ("does " ++ chosen ++ " when c1, c2, c3 are " ++ show (one, two, three)) $
          playingIn still [] (\world -> do
            (C1 `becomes` one) world
            (C2 `becomes` two) world
            (C3 `becomes` three) world
            NestedSelection.bt)
            `shouldReturn` (Gave (), [Did chosen])
    it "switches inside a selection, and from one to the other" $
      playing
        still
        [ During "a1" (untilInterrupted (C2 `becomes` True))
        , During "a2" (untilInterrupted (C1 `becomes` True))
        , During "a4" (untilInterrupted (C3 `becomes` True))
        ]
        NestedSelection.bt
        `shouldReturn` (Gave (), [InterruptedIn "a1", InterruptedIn "a2", InterruptedIn "a4", Did "a5"])

  describe "Paper.PassDoor" $ do
    it "opens the door, passes through, closes it and does the task, each until the next is due" $
      playing
        still
        [ During "open front door" (untilInterrupted (FrontDoor `doorBecomes` Open))
        , During "pass through front door" (untilInterrupted (InsideRoom `becomes` True))
        , During "close front door" (untilInterrupted (FrontDoor `doorBecomes` Closed))
        ]
        PassDoor.passDoor
        `shouldReturn` ( Gave ()
                       , [ InterruptedIn "open front door"
                         , InterruptedIn "pass through front door"
                         , InterruptedIn "close front door"
                         , Did "do task"
                         ]
                       )
    it "opens the door again when it closes meanwhile" $
      playing
        still {frontIs = Open}
        [ During "pass through front door" (untilInterrupted (FrontDoor `doorBecomes` Closed))
        , During "open front door" (untilInterrupted (FrontDoor `doorBecomes` Open))
        , During "pass through front door" (failing "too narrow")
        ]
        PassDoor.passDoor
        `shouldReturn` ( failedBecause "too narrow"
                       , [ InterruptedIn "pass through front door"
                         , InterruptedIn "open front door"
                         , FailedTo "pass through front door" "too narrow"
                         ]
                       )
    it "does the task at once inside, behind a closed door" $
      playingIn still [] (\world -> (InsideRoom `becomes` True) world >> PassDoor.passDoor)
        `shouldReturn` (Gave (), [Did "do task"])
    it "fails when the door is locked" $
      playing still {frontIs = Locked} [] PassDoor.passDoor
        `shouldReturn` ( failedBecause "the front door is locked"
                       , [FailedTo "open front door" "the front door is locked"]
                       )

whenReactive :: Spec
whenReactive = do
  describe "Paper.Battery" $ do
    it "does the task while there is charge" $
      playing still [] Battery.bt `shouldReturn` (Gave (), [Did "task"])
    it "interrupts the task when the battery is low" $
      playing
        still
        [ During "task" (untilInterrupted (batteryDropsTo 10))
        , During "recharge" (failing "no current")
        ]
        Battery.bt
        `shouldReturn` ( failedBecause "no current"
                       , [InterruptedIn "task", FailedTo "recharge" "no current"]
                       )
    it "recharges first when the battery is low at the start" $
      playing
        still {chargedTo = 10}
        [During "recharge" (untilInterrupted (batteryDropsTo 11))]
        Battery.bt
        `shouldReturn` (Gave (), [InterruptedIn "recharge", Did "task"])

  describe "Paper.SequenceAsSelection" $ do
    it "starts the second action when the condition for the end of the first is true" $
      playing still [During "a1" (untilInterrupted (C1 `becomes` True))] SequenceAsSelection.bt
        `shouldReturn` (Gave (), [InterruptedIn "a1", Did "a2"])
    it "skips the first action when that condition is true at the start" $
      playingIn still [] (\world -> (C1 `becomes` True) world >> SequenceAsSelection.bt)
        `shouldReturn` (Gave (), [Did "a2"])

  describe "Paper.Circle" $ do
    it "drives in a circle, then moves to the box" $
      playing still [] Circle.bt `shouldReturn` (Gave (), [Did "circle", Did "move to box"])
    it "with an artificial condition does not move to the box if that is never set" $
      playing still [] Circle.artificial `shouldReturn` (Gave (), [Did "circle"])
    it "with an artificial condition moves to the box when that is set" $
      playing still [During "circle" (untilInterrupted (C1 `becomes` True))] Circle.artificial
        `shouldReturn` (Gave (), [InterruptedIn "circle", Did "move to box"])

preempting :: Spec
preempting = do
  for_ [("Paper.InsideRoom", InsideRoom.bt), ("Paper.Threshold", Threshold.bt)] $ \(name, bt) ->
    describe name $ do
      it "stops on the threshold, and closes the door" $
        playing
          still {frontIs = Open}
          [During "pass through front door" (untilInterrupted (InsideRoom `becomes` True))]
          bt
          `shouldReturn` (Gave (), [InterruptedIn "pass through front door", Did "close front door"])
      it "passes through again when it is moved out before the door is closed" $
        playing
          still {frontIs = Open}
          [ During "pass through front door" (untilInterrupted (InsideRoom `becomes` True))
          , During "close front door" (untilInterrupted (InsideRoom `becomes` False))
          , During "pass through front door" (failing "somebody stands there")
          ]
          bt
          `shouldReturn` ( failedBecause "somebody stands there"
                         , [ InterruptedIn "pass through front door"
                           , InterruptedIn "close front door"
                           , FailedTo "pass through front door" "somebody stands there"
                           ]
                         )
      it "only closes the door when it is inside" $
        playingIn still [] (\world -> (InsideRoom `becomes` True) world >> bt)
          `shouldReturn` (Gave (), [Did "close front door"])

  describe "Paper.Wall" $ do
    it "moves forward until it is close to the wall" $
      playing still [During "move forward" (untilInterrupted (CloseToWall `becomes` True))] Wall.bt
        `shouldReturn` (Gave (), [InterruptedIn "move forward", Did "turn"])
    it "moves forward again when it has turned away" $
      playing
        still
        [ During "move forward" (untilInterrupted (CloseToWall `becomes` True))
        , During "turn" (untilInterrupted (CloseToWall `becomes` False))
        ]
        Wall.bt
        `shouldReturn` (Gave (), [InterruptedIn "move forward", InterruptedIn "turn", Did "move forward"])

  for_ [("Paper.IfNot", IfNot.bt), ("Paper.Unless", Unless.bt)] $ \(name, bt) ->
    describe name $ do
      it "passes through the door and closes it" $
        playing still {frontIs = Open} [] bt
          `shouldReturn` (Gave (), [Did "pass through front door", Did "close front door"])
      it "only closes the door when it is inside" $
        playingIn still [] (\world -> (InsideRoom `becomes` True) world >> bt)
          `shouldReturn` (Gave (), [Did "close front door"])
      it "tests the condition once, and watches nothing" $
        playing
          still {frontIs = Open}
          [During "pass through front door" unwatched, During "close front door" unwatched]
          bt
          `shouldReturn` (Gave (), [Did "pass through front door", Did "close front door"])
      it "does not close the door when it could not pass through" $
        playing still [] bt
          `shouldReturn` ( failedBecause "the front door is not open"
                         , [FailedTo "pass through front door" "the front door is not open"]
                         )
      it "does nothing when the condition fails" $
        playingIn still [] (withoutSensors bt) `shouldReturn` (failedBecause "the sensor is broken", [])

oneSided :: Spec
oneSided = do
  describe "Paper.Chattering" $
    it "interrupts the task, the recharging, the task, the recharging ..." $
      playing
        still
        [ During "task" (untilInterrupted (batteryDropsTo 10))
        , During "recharge" (untilInterrupted (batteryDropsTo 11))
        , During "task" (untilInterrupted (batteryDropsTo 10))
        , During "recharge" (untilInterrupted (batteryDropsTo 11))
        ]
        Chattering.bt
        `shouldReturn` ( Gave ()
                       , [ InterruptedIn "task"
                         , InterruptedIn "recharge"
                         , InterruptedIn "task"
                         , InterruptedIn "recharge"
                         , Did "task"
                         ]
                       )

  describe "Paper.MonitorBattery" $ do
    it "recharges to the end, even if the battery is no longer low, and then does the task" $
      playing
        still
        [ During "task" (untilInterrupted (batteryDropsTo 9))
        , During "recharge" (batteryDropsTo 11)
        , During "task" (untilInterrupted (batteryDropsTo 9))
        ]
        MonitorBattery.bt
        `shouldReturn` ( Gave ()
                       , [InterruptedIn "task", Did "recharge", InterruptedIn "task", Did "recharge", Did "task"]
                       )
    it "fails when recharging fails" $
      playing still {chargedTo = 9} [During "recharge" (failing "no current")] MonitorBattery.bt
        `shouldReturn` (failedBecause "no current", [FailedTo "recharge" "no current"])

withData :: Spec
withData =
  for_
    [ ("Paper.FindBox", FindBox.bt)
    , ("Paper.FindBoxLambda", FindBoxLambda.bt)
    , ("Paper.FindBoxDo", FindBoxDo.bt)
    , ("Paper.Bind", Bind.bt)
    , ("Paper.BindDo", BindDo.bt)
    , ("Paper.BindLambda", BindLambda.bt)
    ]
    $ \(name, bt) -> describe name $ do
      it "finds the box, then moves to it" $
        playing still [] bt `shouldReturn` (Gave (), [Did "find box", Did "move to box"])
      it "moves nowhere when there is no box" $
        playing still [During "find box" (failing "no box here")] bt
          `shouldReturn` (failedBecause "no box here", [FailedTo "find box" "no box here"])

conditions :: Spec
conditions =
  describe "Paper.DangerNearby" $ do
    it "does the task" $
      playing still [] DangerNearby.bt `shouldReturn` (Gave (), [Did "do task"])
    it "hides when there is danger, to the end, and then does the task" $
      playing still [During "do task" (untilInterrupted (DangerNearby `becomes` True))] DangerNearby.bt
        `shouldReturn` (Gave (), [InterruptedIn "do task", Did "hide", Did "do task"])
    it "hides first when there is danger at the start" $
      playingIn still [] (\world -> (DangerNearby `becomes` True) world >> DangerNearby.bt)
        `shouldReturn` (Gave (), [Did "hide", Did "do task"])
    it "fails, and does nothing, when danger cannot be sensed" $
      playingIn still [] (withoutSensors DangerNearby.bt)
        `shouldReturn` (failedBecause "the sensor is broken", [])
    it "stops the task when danger can no longer be sensed" $
      playing still [During "do task" (withoutSensors hang)] DangerNearby.bt
        `shouldReturn` (failedBecause "the sensor is broken", [InterruptedIn "do task"])

specification :: Spec
specification = do
  for_ [("Paper.Then", Then.bt), ("Paper.ThenBind", ThenBind.bt), ("Paper.ThenDo", ThenDo.bt)] $
    \(name, bt) -> describe name $ do
      it "does the first, then the second" $
        playing still [] bt
          `shouldReturn` (Gave (), [Did "open front door", Did "pass through front door"])
      it "does not do the second when the first fails" $
        playing still {frontIs = Locked} [] bt
          `shouldReturn` ( failedBecause "the front door is locked"
                         , [FailedTo "open front door" "the front door is locked"]
                         )

  describe "Paper.FallbackInfix" $ do
    it "does nothing else when the first succeeds" $
      playing still [] FallbackInfix.bt `shouldReturn` (Gave (), [Did "open front door"])
    it "does the second when the first fails" $
      playing still {frontIs = Locked} [] FallbackInfix.bt
        `shouldReturn` ( Gave ()
                       , [FailedTo "open front door" "the front door is locked", Did "smash front door"]
                       )
    it "does not take a fault for a failure" $
      playing still [During "open front door" (\_ -> throwIO (Fault "short circuit"))] FallbackInfix.bt
        `shouldReturn` ( FaultedWith "Fault \"short circuit\""
                       , [FaultedIn "open front door" "Fault \"short circuit\""]
                       )

  describe "Paper.FallbackByCatch" $
    for_ [("fallback", FallbackByCatch.fallback), ("?", (FallbackByCatch.?))] $ \(name, orElse) ->
      it (name ++ " runs its second behaviour when the first fails, and only then") $ do
        (failed `orElse` pure "second") `shouldReturn` "second"
        (pure "first" `orElse` pure "second") `shouldReturn` "first"
        ending (throwIO (Fault "bug") `orElse` pure "second")
          `shouldReturn` FaultedWith "Fault \"bug\""
