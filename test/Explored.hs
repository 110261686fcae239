-- |
-- Random programs under explored schedules. Everything here runs in simulations, which are the same
-- under each runtime.
module Main (main) where

import Test.Hspec

import qualified Promises.PromisesSimSpec
import qualified SemanticsSpec
import qualified Sim.ExploreSpaceSpec
import qualified Trace.MessagesSpec
import qualified Trace.ProgramsSpec

main :: IO ()
main = hspec $ do
  describe "Promises, under all schedules" Promises.PromisesSimSpec.spec
  describe "Specification" SemanticsSpec.spec
  describe "Traces of random programs" $ do
    Trace.ProgramsSpec.spec
    Trace.MessagesSpec.spec
  describe "Many schedules" Sim.ExploreSpaceSpec.spec
