-- |
-- The reactive operators, filters and messages run in constant memory, however often they switch, and never
-- run two branches at the same time in a million switches.
module Behavior.ReactiveSpaceSpec (spec) where

import Control.Concurrent.STM hiding (atomically)
import Control.Monad (replicateM_, unless)
import Data.IORef (modifyIORef', newIORef, readIORef, writeIORef)
import Test.Hspec

import Behavior.Internal.Seam.Runtime (atomically)
import Behavior.Message (onMessage, withInbox)
import qualified Behavior.Signal as Signal
import Memory
import Support
import Watched

-- | A million switches take seconds; so these examples have a watchdog of their own. And
-- they run on one capability: on several, GHC's transactions sometimes wait for each other
-- by spinning, for as long as the operating system lets them. That may take milliseconds
-- each time, and has nothing to do with memory.
spec :: Spec
spec = around_ (within 120 . leavingNothing . onOneCapability) . describe "In constant memory:" $ do
  it "a million reselections by rSelect, one branch at a time" $
    inConstantMemory 1000000 $ \step -> do
      occupancy <- newOccupancyCounter
      condition <- newTVarIO True
      left <- newTVarIO (1000000 :: Int)
      let branch = inside occupancy $ do
            step
            over <- atomically $ do
              modifyTVar' left (subtract 1)
              modifyTVar' condition not
              (<= 0) <$> readTVar left
            unless over hang
      Signal.rSelect (watchedVar condition) branch branch
      mostInside occupancy `shouldReturn` 1

  it "a million recoveries by monitor" $
    inConstantMemory 1000000 $ \step -> do
      low <- newTVarIO (1000000 :: Int)
      let recovery = step >> atomically (modifyTVar' low (subtract 1))
      Signal.monitor ((> 0) <$> watchedVar low) recovery (pure ())

  it "a million interruptions by monitor, and as many recoveries, one behaviour at a time" $
    inConstantMemory 1000000 $ \step -> do
      occupancy <- newOccupancyCounter
      condition <- newTVarIO False
      left <- newTVarIO (1000000 :: Int)
      let task = inside occupancy $ do
            step
            over <- atomically $ do
              modifyTVar' left (subtract 1)
              writeTVar condition True
              (<= 0) <$> readTVar left
            unless over hang
          recovery = inside occupancy (atomically (writeTVar condition False))
      Signal.monitor (watchedVar condition) recovery task
      mostInside occupancy `shouldReturn` 1

  it "a hundred thousand recoveries on a signal that needs a thread, each time a new one" $
    inConstantMemory 100000 $ \step -> do
      level <- newTVarIO (100000 :: Int)
      let recovery = step >> atomically (modifyTVar' level (subtract 1))
      Signal.monitor (Signal.hysteresis False 0 1 (watchedVar level)) recovery (pure ())

  it "a hundred thousand operators on one shared signal" $
    inConstantMemory 100000 $ \step ->
      Signal.withShared (Signal.hysteresis False 0 1 (pure (1 :: Int))) $ \s ->
        replicateM_ 100000 (step >> Signal.waitUntil s)

  it "a hundred thousand changes" $
    inConstantMemory 100000 $ \step -> do
      level <- newTVarIO (0 :: Int)
      count <- newIORef (0 :: Int)
      Signal.switch (Signal.changes (watchedVar level)) $ \_ -> do
        step
        modifyIORef' count (+ 1)
        n <- readIORef count
        unless (n > 100000) (atomically (modifyTVar' level (+ 1)) >> hang)

  it "a hundred thousand messages" $
    inConstantMemory 100000 $ \step -> do
      count <- newTVarIO (0 :: Int)
      deliverNext <- newIORef (pure ())
      withInbox 1 (\deliver -> pure () <$ (writeIORef deliverNext (deliver ()) >> deliver ())) $ \box -> do
        next <- readIORef deliverNext
        let handle () = pure (modifyTVar' count (+ 1))
            task = do
              step
              n <- readTVarIO count
              unless (n >= 100000) (next >> hang)
        onMessage box handle task
