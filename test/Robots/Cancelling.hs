{-# LANGUAGE OverloadedStrings #-}

-- |
-- Rows 2, 3 and 4: goals that are cancelled.
module Robots.Cancelling
  ( atRandomInstants
  , atOnce
  , neverConfirmed
  ) where

import Control.Monad (replicateM_, unless, void, when)
import Data.Aeson ((.=))
import Data.Foldable (traverse_)

import Behavior
import Behavior.Internal.Seam.Runtime (liveThreadCount)
import Behavior.Ros
import Behavior.Ros.Action
import qualified Behavior.Signal as Signal
import Robots.Campaign
import Robots.Goals

-- | Cancelled at random instants, half of them on a server that looks every 10 ms, half on one that looks every 150.
atRandomInstants :: Campaign -> Behavior ()
atRandomInstants campaign = withBridge campaign 1 $ \_ bridge -> withRos bridge $ \ros -> do
  awaitServers campaign 2 bridge ["/fast", "/slow"]
  let n = if isLong campaign then 500 else 200
      some name = replicateM_ n $ do
        instant <- somewhere 0.01 0.3
        void $ interrupted campaign 2 [("server", name)] (sleep instant) (plainly ros (fibonacci name))
  some "/fast" `both` some "/slow"

-- | Cancelled within a millisecond of being sent, a hundred on each server: at an instant of what is left of the first
-- 0.8 ms. (Some are later, for threads wait for the processor: they are not counted.)
atOnce :: Campaign -> Behavior ()
atOnce campaign = withBridge campaign 1 $ \_ bridge -> withRos bridge $ \ros -> do
  awaitServers campaign 3 bridge ["/fast", "/slow"]
  let some tries n name = unless (n == 0) $ do
        when (tries == 0) $ failWith ("too few goals were cancelled at once on " ++ name)
        begun <- clock
        let soon = do
              Signal.waitUntil ((> 0) <$> movingGoals ros)
              sent <- clock
              sleep =<< somewhere 0 (max 0 (begun + 0.0008 - sent))
        stopped <- interrupted campaign 3 [("server", name)] soon (plainly ros (fibonacci name))
        some (tries - 1) (if any (<= begun + 0.001) stopped then n - 1 else n) name
  traverse_ (some (400 :: Int) (100 :: Int)) ["/fast", "/slow"]

-- | A server that never confirms: it works on each goal to its end.
neverConfirmed :: Campaign -> Behavior ()
neverConfirmed campaign = withBridge campaign 1 $ \_ bridge -> replicateM_ (if isLong campaign then 10 else 2) $ do
  awaitServers campaign 4 bridge ["/stubborn"]
  before <- liveThreadCount
  withRos bridge $ \ros -> do
    let which = fibonacci "/stubborn"
        stopped kind = void . interrupted campaign 4 [("kind", kind)] (sleep 0.3)
    stopped "first" (plainly ros which)
    stopped "refused" (plainly ros which)
    stopped "replacing" (plainly ros (replacing which))
    within 20 "the end of the goals" ((== 0) <$> movingGoals ros)
    stopped "afterwards" (plainly ros which)
  after <- liveThreadCount
  note campaign 4 ["threads before" .= before, "threads after" .= after]
