{-# LANGUAGE GeneralizedNewtypeDeriving #-}

-- |
-- The operators in a monad of the user's own: their promises hold there. (The page "Your own monad"
-- has examples, which run.)
module Examples.YourOwnMonadSpec (spec) where

import Control.Concurrent.STM (TVar, modifyTVar', newTVarIO, readTVar, readTVarIO, writeTVar)
import Control.Exception (onException)
import Control.Monad (void)
import Control.Monad.IO.Class (MonadIO (..))
import Control.Monad.IO.Unlift (MonadUnliftIO)
import Control.Monad.Trans.Reader (ReaderT (..), asks)
import Test.Hspec

import Behavior.Sim (exhaustively, explore)
import Behavior.UnliftIO
import Behavior.UnliftIO.Parallel (allOf)
import Behavior.UnliftIO.STM (atomically)
import qualified Behavior.UnliftIO.Signal as Signal
import Support (guarded)

-- | What every part of the mission can use.
data Rover = Rover
  { low :: TVar Bool
  , running :: TVar Int
  -- ^ How many of its behaviours run.
  , record :: TVar [String]
  }

newtype Mission a = Mission (ReaderT Rover IO a)
  deriving (Functor, Applicative, Monad, MonadIO, MonadUnliftIO)

runMission :: Mission a -> Rover -> IO a
runMission (Mission act) = runReaderT act

env :: (Rover -> a) -> Mission a
env = Mission . asks

spec :: Spec
spec = guarded $ do
  it "an operator stops and restarts behaviours of that monad, and never runs two, under all schedules" $
    void . explore (exhaustively 1) $ \simulated -> do
      rover <- Rover <$> newTVarIO False <*> newTVarIO 0 <*> newTVarIO []
      _ <- simulated (runMission mission rover)
      readTVarIO (running rover) `shouldReturn` 0
      reverse <$> readTVarIO (record rover) `shouldReturn` ["drive", "recharge", "drive"]

  it "a failure in that monad is a failure, and the environment is the same in every branch" $ do
    rover <- Rover <$> newTVarIO False <*> newTVarIO 0 <*> newTVarIO []
    same <- runMission (allOf [env low, liftIO failed ? env low]) rover
    map (== low rover) same `shouldBe` [True, True]

-- | Drives; the battery becomes low on the way.
mission :: Mission ()
mission = do
  batteryLow <- env (Signal.watching . readTVar . low)
  charge <- env (\rover -> atomically (writeTVar (low rover) False))
  drain <- env (\rover -> sleep 1 >> atomically (writeTVar (low rover) True) >> sleep 3)
  let recharge = doing "recharge" 1 >> liftIO charge
  liftIO drain `both` Signal.monitor batteryLow recharge (doing "drive" 2)

-- | A behaviour that must be the only one.
doing :: String -> Seconds -> Mission ()
doing name seconds = do
  count <- env running
  notes <- env record
  liftIO $ do
    others <- atomically (modifyTVar' notes (name :) >> modifyTVar' count (+ 1) >> readTVar count)
    let leave = atomically (modifyTVar' count (subtract 1))
    if others > 1 then error (name ++ " is not alone") else (sleep seconds `onException` leave) >> leave
