-- |
-- That the reactive operators run in constant memory, however often they switch.
module Behavior.ReactiveSpaceSpec (spec) where

import Control.Concurrent.STM hiding (atomically)
import Control.Monad (replicateM_, unless)
import Test.Hspec

import Behavior.Internal.Runtime (atomically)
import qualified Behavior.Signal as Signal
import Memory
import Support
import Watched

-- | A million take several seconds, more on a slow machine: so these have a
-- watchdog of their own.
spec :: Spec
spec = around_ (within 120 . leavingNothing) . describe "In constant memory run" $ do
  it "a million reselections by rSelect" $
    inConstantMemory 1000000 $ \step -> do
      dial <- newTVarIO True
      left <- newTVarIO (1000000 :: Int)
      let branch = do
            step
            over <- atomically $ do
              modifyTVar' left (subtract 1)
              modifyTVar' dial not
              (<= 0) <$> readTVar left
            unless over hang
      Signal.rSelect (dialled dial) branch branch

  it "a million recoveries by monitor" $
    inConstantMemory 1000000 $ \step -> do
      dial <- newTVarIO True
      left <- newTVarIO (1000000 :: Int)
      let recovery = do
            step
            atomically $ do
              modifyTVar' left (subtract 1)
              readTVar left >>= writeTVar dial . (> 0)
      Signal.monitor (dialled dial) recovery (pure ())

  it "a hundred thousand interruptions by monitor, and as many recoveries" $
    inConstantMemory 100000 $ \step -> do
      dial <- newTVarIO False
      left <- newTVarIO (100000 :: Int)
      let task = do
            step
            over <- atomically $ do
              modifyTVar' left (subtract 1)
              writeTVar dial True
              (<= 0) <$> readTVar left
            unless over hang
          recovery = atomically (writeTVar dial False)
      Signal.monitor (dialled dial) recovery task

  it "a hundred thousand recoveries on a signal that needs a thread, each time a new one" $
    inConstantMemory 100000 $ \step -> do
      level <- newTVarIO (100000 :: Int)
      let recovery = step >> atomically (modifyTVar' level (subtract 1))
      Signal.monitor (Signal.hysteresis 0 1 (dialled level)) recovery (pure ())

  it "a hundred thousand operators on one shared signal" $
    inConstantMemory 100000 $ \step ->
      Signal.withShared (Signal.hysteresis 0 1 (pure (1 :: Int))) $ \s ->
        replicateM_ 100000 (step >> Signal.waitUntil s)
