-- |
-- What depends on the runtime: threads are started, and exceptions reach them (also those of a
-- simulation are real ones).
module Main (main) where

import Test.Hspec

import qualified Behavior.AbandoningSpec
import qualified Behavior.AgreeingSpec
import qualified Behavior.BadReadingSpec
import qualified Behavior.CancellationStressSpec
import qualified Behavior.CleanupSpec
import qualified Behavior.DecideSpec
import qualified Behavior.EqualitySuppressionSpec
import qualified Behavior.FailureSpec
import qualified Behavior.FilterSpec
import qualified Behavior.FromOutsideSpec
import qualified Behavior.InsteadWhenSpec
import qualified Behavior.MessageRuleSpec
import qualified Behavior.MessageSpec
import qualified Behavior.MonitorSpec
import qualified Behavior.OperatorsSpec
import qualified Behavior.OutcomeSpec
import qualified Behavior.ParallelSpec
import qualified Behavior.PausingSpec
import qualified Behavior.PinnedSpec
import qualified Behavior.PolledSpec
import qualified Behavior.PollingSpec
import qualified Behavior.PromisesSpec
import qualified Behavior.RateSpec
import qualified Behavior.ReactiveSpec
import qualified Behavior.RepeatingSpec
import qualified Behavior.ResumableSpec
import qualified Behavior.RunBehaviorSpec
import qualified Behavior.RuntimeSpec
import qualified Behavior.STMSpec
import qualified Behavior.ScopedSpec
import qualified Behavior.SemaphoreSpec
import qualified Behavior.SignalSpec
import qualified Behavior.ThrowingCleanupSpec
import qualified Behavior.TimeSpec
import qualified Behavior.TimerWheelSpec
import qualified Behavior.UnliftIOSpec
import qualified Examples.GreenhouseRoverSpec
import qualified OrdinaryWordsSpec
import qualified Paper.DoorsSpec
import qualified Paper.ErrataSpec
import qualified Paper.ListingsSpec
import qualified Paper.SyntaxSpec
import qualified Reality.RealitySpec
import Ros.Bridge (orBridge)
import Ros.Cases (servers)
import qualified Ros.CasesSpec
import qualified Ros.TlsSpec
import qualified Ros.WebsocketSpec
import qualified Sim.ClaimSpec
import qualified Sim.DeliverySpec
import qualified Sim.EndSpec
import qualified Sim.ExploreSpec
import qualified Sim.MockSpec
import qualified Sim.PremiseSpec
import qualified Sim.QuickCheckSpec
import qualified Sim.RecordSpec
import qualified Sim.SimulateSpec
import qualified Sim.SlipSpec
import qualified Sim.VacuousSpec
import qualified Trace.SinkSpec
import qualified Trace.TraceSpec

main :: IO ()
main = orBridge servers . hspec $ do
  describe "Failure" Behavior.FailureSpec.spec
  describe "Parallel" $ do
    Behavior.ParallelSpec.spec
    Behavior.DecideSpec.spec
    Behavior.AgreeingSpec.spec
    Behavior.PinnedSpec.spec
    describe "scoped and fork" Behavior.ScopedSpec.spec
  describe "Signal" $ do
    Behavior.SignalSpec.spec
    Behavior.PollingSpec.spec
    Behavior.BadReadingSpec.spec
    Behavior.EqualitySuppressionSpec.spec
    Behavior.FilterSpec.spec
    Behavior.RateSpec.spec
    Behavior.OperatorsSpec.spec
    Behavior.OutcomeSpec.spec
    Behavior.ReactiveSpec.spec
    Behavior.MonitorSpec.spec
    Behavior.InsteadWhenSpec.spec
    Behavior.PausingSpec.spec
  describe "The paper's rSelect and monitor" Behavior.PolledSpec.spec
  describe "Time" $ do
    Behavior.TimeSpec.spec
    Behavior.CleanupSpec.spec
    Behavior.AbandoningSpec.spec
    Behavior.RepeatingSpec.spec
    Behavior.TimerWheelSpec.spec
  describe "STM" $ do
    Behavior.STMSpec.spec
    describe "resumable" Behavior.ResumableSpec.spec
    describe "withTSem" Behavior.SemaphoreSpec.spec
  describe "Messages" Behavior.MessageSpec.spec
  describe "Messages as a rule" Behavior.MessageRuleSpec.spec
  describe "Your own monad" Behavior.UnliftIOSpec.spec
  describe "Runtime" Behavior.RuntimeSpec.spec
  describe "Running a program" Behavior.RunBehaviorSpec.spec
  describe "From outside" $ do
    Behavior.FromOutsideSpec.spec
    Behavior.ThrowingCleanupSpec.spec
  describe "Promises" Behavior.PromisesSpec.spec
  describe "Cancellation stress" Behavior.CancellationStressSpec.spec
  describe "Simulation" $ do
    Sim.SimulateSpec.spec
    Sim.DeliverySpec.spec
    Sim.EndSpec.spec
    Sim.SlipSpec.spec
    Sim.ExploreSpec.spec
    Sim.RecordSpec.spec
    Sim.ClaimSpec.spec
    Sim.MockSpec.spec
    Sim.VacuousSpec.spec
    Sim.PremiseSpec.spec
    Sim.QuickCheckSpec.spec
  describe "Traces" $ do
    Trace.TraceSpec.spec
    Trace.SinkSpec.spec
  describe "Robots over a websocket" Ros.WebsocketSpec.spec
  describe "Robots over a websocket that is encrypted (wss):" Ros.TlsSpec.spec
  describe "Robots do the same:" Ros.CasesSpec.spec
  describe "Reality" Reality.RealitySpec.spec
  describe "Names" OrdinaryWordsSpec.spec
  describe "The paper" $ do
    Paper.ListingsSpec.spec
    Paper.DoorsSpec.spec
    Paper.SyntaxSpec.spec
    Paper.ErrataSpec.spec
  describe "Examples" $ describe "greenhouse-rover" Examples.GreenhouseRoverSpec.spec
