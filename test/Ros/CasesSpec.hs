-- |
-- A fake robot in a simulation and one behind a bridge in another process do the same. (So does a real one:
-- @make robots@.)
module Ros.CasesSpec (spec) where

import Data.Foldable (for_)
import Test.Hspec

import Behavior.Ros
import Behavior.Ros.Fake
import Ros.Bridge
import Ros.Cases
import Ros.Stage (patient, underSchedules)
import Support (guarded)

spec :: Spec
spec = guarded . for_ cases $ \each -> describe (title each) $ do
  it "with a fake robot, under many schedules" . underSchedules 40 . withFakeRobot servers $ \robot -> do
    let host ros = Host ros (loseLink robot) (restoreLink robot)
    withRosOptions impatient (fakeRos robot) (mission each . host) >>= (`shouldBe` outcome each)
  it "with a bridge in another process" . withBridgeProcess $ \way cuts mends -> do
    let host ros = Host ros cuts mends
    withRosOptions (if isInVain each then impatient else patient) way (mission each . host)
      >>= (`shouldBe` outcome each)
 where
  -- (There something is waited for that never comes.)
  isInVain each = any (`elem` outcome each) ["NotConfirmed", "LinkLost"]
