-- |
-- Random missions of a robot, each under random schedules.
--
-- (That broken goals are rejected is shown by the mutants in test/mutants/Ros.txt.)
module Ros.PromisesSpec (spec) where

import Test.Hspec

import Promises.Stage (promised)
import Promises.Trying
import Ros.Promised
import Support (sampleSize)

spec :: Spec
spec = do
  schedules <- runIO (sampleSize 2000)
  it (promised keptByMissions) $ do
    tried <- underRandom 1 schedules keptByMissions
    schedulesExplored tried `shouldSatisfy` (>= schedules)
