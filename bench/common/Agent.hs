{-# LANGUAGE LambdaCase #-}

-- |
-- The robot of the paper's section 6, one of many.
module Agent
  ( Agent (..)
  , newAgent
  , mission
  ) where

import Control.Concurrent.STM (TVar, newTVarIO, readTVar, retry, writeTVar)

import Behavior
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal

-- | What the program of a robot reads.
data Agent = Agent
  { battery :: TVar Int
  , progress :: TVar Progress
  }

data Door = Front | Back
  deriving (Eq)

data Step = Open Door | PassThrough Door | Task
  deriving (Eq)

-- | How the robot's latest step ended, if it has.
data Progress = None | Done Step | Undone Step

newAgent :: IO Agent
newAgent = Agent <$> newTVarIO 100 <*> newTVarIO None

-- | Enters the room, by one door or the other, and does the task there; recharges when
-- the battery is low. The given action runs at each start of the mission.
mission :: Agent -> Behavior () -> Behavior ()
mission agent start = Signal.monitor batteryLow recharge (start >> enterRoom >> does Task)
 where
  batteryLow = (< 10) <$> Signal.watching (readTVar (battery agent))
  recharge = atomically (writeTVar (battery agent) 100)
  enterRoom = enterBy Front ? enterBy Back
  enterBy door = does (Open door) >> does (PassThrough door)
  does step =
    atomically $
      readTVar (progress agent) >>= \case
        Done it | it == step -> pure ()
        Undone it | it == step -> failed
        _ -> retry
