-- |
-- A scripted robot for tests. In a simulation ("Behavior.Sim") every schedule of a mission can be tried with it: with
-- goals that are slow, rejected, aborted or never confirmed, and with a link that is lost.
--
-- >>> let server _ = succeeding {endsAfter = 3}
-- >>> :{
-- void . simulate . withFakeRobot [("/carry", server)] $ \robot -> withRos (fakeRos robot) $ \ros -> do
--   _ <- goal ros (untyped "/carry" "my_robot/action/Carry") (toRos True)
--   atomically (seen robot) >>= mapM_ print
-- :}
-- (0.0,Connected)
-- (0.0,GoalCame 1 "/carry" (Bool True))
-- (3.0,GoalEnded 1 4)
module Behavior.Ros.Fake
  ( -- * The robot
    FakeRobot
  , withFakeRobot
  , fakeRos

    -- * Its actions
  , GoalScript (..)
  , GoalEnd (..)
  , succeeding

    -- * Its services
  , ServiceScript (..)
  , answering
  , offerService

    -- * What a test does with it
  , publish
  , sendBytes
  , loseLink
  , restoreLink
  , freezeLink
  , workSerially

    -- * What it has seen
  , Seen (..)
  , seen
  , runningGoals
  ) where

import Behavior.Ros.Internal.FakeBridge
import Behavior.Ros.Internal.FakeRobot
import Behavior.Ros.Internal.FakeScript

-- $setup
-- >>> import Behavior.Ros
-- >>> import Behavior.Ros.Action
-- >>> import Behavior.STM (atomically)
-- >>> import Behavior.Sim (simulate)
-- >>> import Control.Monad (void)
