-- |
-- Random missions of a robot, each under random schedules.
--
-- (That broken goals are rejected is shown by the mutants in test/mutants/Ros.txt.)
module Ros.PromisesSpec (spec) where

import Test.Hspec

import Promises.Stage (promised)
import Promises.Trying
import Ros.Promised
import Support (everywhere)

spec :: Spec
spec = do
  schedules <- runIO everywhere >>= \isAll -> pure (if isAll then 2000 else 300)
  it (promised keptByMissions) $ do
    tried <- underRandom 1 schedules keptByMissions
    schedulesExplored tried `shouldSatisfy` (>= schedules)
