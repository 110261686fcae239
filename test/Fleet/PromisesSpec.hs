-- |
-- Random days of a fleet, each under random schedules.
--
-- (That broken fleets are rejected is shown by the mutants in test/mutants/Fleet.txt.)
module Fleet.PromisesSpec (spec) where

import Test.Hspec

import Fleet.Promised
import Promises.Stage (promised)
import Promises.Trying
import Support (sampleSize)

spec :: Spec
spec = do
  schedules <- runIO (sampleSize 300)
  it (promised keptByFleets) $ do
    tried <- underRandom 1 schedules keptByFleets
    schedulesExplored tried `shouldSatisfy` (>= schedules)
