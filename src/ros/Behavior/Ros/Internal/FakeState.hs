{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- What a fake robot consists of, and what it sends.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.FakeState
  ( FakeRobot (..)
  , Client (..)
  , Goal (..)
  , goalId

    -- * What it sends
  , answer
  , publishNow
  , publishStatus

    -- * Its record
  , note
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Monad (filterM, unless, when)
import Data.Aeson (Value, object, (.=))
import Data.ByteString.Lazy (ByteString)
import Data.Foldable (traverse_)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Set (Set)
import qualified Data.Set as Set
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Behavior, Seconds)
import Behavior.Ros.Internal.FakeScript
import Behavior.Ros.Internal.Frame
import Behavior.Ros.Internal.Message
import Behavior.Ros.Internal.Status (Statuses (..), statusOf)

-- | A robot with a bridge that exists only in the program, for simulations ("Behavior.Sim") and tests.
--
-- @since 0.1.0.0
data FakeRobot = FakeRobot
  { scripts :: Map Text (Value -> GoalScript)
  , newGoals :: TQueue Goal
  , goals :: TVar (Map Int Goal)
  , goalCount :: TVar Int
  , services :: TVar (Map Text (Value -> ServiceScript))
  , newCalls :: TQueue (Behavior ())
  , clients :: TVar [Client]
  , isReachable :: TVar Bool
  , isFrozen :: TVar Bool
  , isSerial :: TVar Bool
  -- ^ Whether the bridge works on requests only while no goal runs.
  , lastPublished :: TVar (Map Text Value)
  , record :: TVar [(Seconds, Seen)]
  }

-- | What is connected to the bridge.
data Client = Client
  { toClient :: TQueue ByteString
  , isBroken :: TVar Bool
  , subscribed :: TVar (Set Text)
  }

-- | A goal that was sent to the robot.
data Goal = Goal
  { number :: Int
  , sender :: Client
  , idThere :: Id
  , action :: Text
  , script :: GoalScript
  , isAccepted :: TVar Bool
  , cancelWanted :: TVar Bool
  }

-- | How the robot names a goal.
goalId :: Int -> Value
goalId n = object ["uuid" .= [n]]

-- | Sends an answer, if the connection is still there.
answer :: Client -> Answer -> STM ()
answer it what = readTVar (isBroken it) >>= \broken -> unless broken (writeTQueue (toClient it) (encodeAnswer what))

-- | Adds to its record.
note :: FakeRobot -> Seconds -> Seen -> STM ()
note robot time what = modifyTVar' (record robot) ((time, what) :)

-- | Publishes the status of each goal of the action that was accepted, as servers do whenever that changes.
publishStatus :: FakeRobot -> Text -> STM ()
publishStatus robot name = do
  running <- readTVar (goals robot) >>= filterM isRunning . Map.elems
  moving <- traverse (\g -> (\stops -> (number g, if stops then 3 else 2)) <$> readTVar (cancelWanted g)) running
  known <- map snd <$> readTVar (record robot)
  let ofAction = [n | GoalCame n actionName _ <- known, actionName == Text.unpack name]
      ended = [(n, status) | GoalEnded n status <- known, n `elem` ofAction, status /= 0]
  publishNow robot (statusOf name) . toRos . Statuses $
    [(goalId n, status) | (n, status) <- moving ++ ended]
 where
  isRunning g = (action g == name &&) <$> readTVar (isAccepted g)

-- | Publishes a message, and keeps it for those who subscribe later.
publishNow :: FakeRobot -> Text -> Value -> STM ()
publishNow robot name value = do
  modifyTVar' (lastPublished robot) (Map.insert name value)
  readTVar (clients robot) >>= traverse_ (\it -> do
    wanted <- Set.member name <$> readTVar (subscribed it)
    when wanted (answer it (Message name value)))
