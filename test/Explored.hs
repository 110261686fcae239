-- |
-- What is the same under each runtime: random programs under explored schedules (everything there runs in
-- simulations), and how time and memory grow.
module Main (main) where

import Test.Hspec

import qualified Behavior.ReactiveSpaceSpec
import qualified Behavior.ResumableSimSpec
import qualified Behavior.ScaleSpec
import qualified Behavior.SemaphoreSimSpec
import qualified Behavior.SpaceSpec
import qualified Examples.DoorBatterySpec
import qualified Examples.DroneSpec
import qualified Examples.FleetMissionSpec
import qualified Examples.FleetSpec
import qualified Examples.PatrolSpec
import qualified Examples.PickAndPlaceSpec
import qualified Examples.ProgressProblemSpec
import qualified Examples.RosMissionSpec
import qualified Examples.TestingARobotSpec
import qualified Examples.YourOwnMonadSpec
import qualified Fleet.ModelSpec
import qualified Fleet.PromisesSpec
import qualified Fleet.ResourceSpec
import qualified Fleet.TaskSpec
import qualified Promises.PromisesSimSpec
import qualified Ros.CallSpec
import qualified Ros.GoalSpec
import qualified Ros.LinkSpec
import qualified Ros.MessagesSpec
import qualified Ros.PeersSpec
import qualified Ros.PromisesSpec
import qualified Ros.TopicSpec
import qualified SemanticsSpec
import qualified Sim.ExploreSpaceSpec
import qualified Trace.MessagesSpec
import qualified Trace.ProgramsSpec

main :: IO ()
main = hspec $ do
  describe "Promises, under all schedules" Promises.PromisesSimSpec.spec
  describe "resumable" Behavior.ResumableSimSpec.spec
  describe "withTSem" Behavior.SemaphoreSimSpec.spec
  describe "Specification" SemanticsSpec.spec
  describe "Traces of random programs" $ do
    Trace.ProgramsSpec.spec
    Trace.MessagesSpec.spec
  describe "Robots" $ do
    Ros.GoalSpec.spec
    Ros.PromisesSpec.spec
    describe "What the peers test of their clients of actions" Ros.PeersSpec.spec
    Ros.TopicSpec.spec
    Ros.LinkSpec.spec
    Ros.CallSpec.spec
    Ros.MessagesSpec.spec
  describe "Fleets" $ do
    Fleet.ModelSpec.spec
    Fleet.TaskSpec.spec
    Fleet.ResourceSpec.spec
    Fleet.PromisesSpec.spec
  describe "Examples" $ do
    describe "door-battery" Examples.DoorBatterySpec.spec
    describe "progress-problem" Examples.ProgressProblemSpec.spec
    describe "ros-mission" Examples.RosMissionSpec.spec
    describe "fleet-mission" Examples.FleetMissionSpec.spec
    describe "Robots" $ do
      describe "patrol" Examples.PatrolSpec.spec
      describe "pick-and-place" Examples.PickAndPlaceSpec.spec
      describe "drone" Examples.DroneSpec.spec
      describe "fleet" Examples.FleetSpec.spec
    describe "testing-a-robot" Examples.TestingARobotSpec.spec
    describe "your own monad" Examples.YourOwnMonadSpec.spec
  describe "Many schedules" Sim.ExploreSpaceSpec.spec
  describe "Space" $ do
    Behavior.SpaceSpec.spec
    Behavior.ReactiveSpaceSpec.spec
    Behavior.ScaleSpec.spec
