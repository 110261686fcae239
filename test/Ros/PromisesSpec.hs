-- |
-- Random missions of a robot, each under random schedules.
--
-- (That broken goals are rejected is shown by the mutants in test/mutants/Ros.txt.)
module Ros.PromisesSpec (spec) where

import Test.Hspec

import Promises.Stage (promised)
import Promises.Trying
import Ros.Promised
import Support (sampleOf)

spec :: Spec
spec =
  it (promised keptByMissions) $ do
    schedules <- sampleOf 2000
    tried <- underRandom 1 schedules keptByMissions
    schedulesExplored tried `shouldSatisfy` (>= schedules)
