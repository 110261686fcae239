{-# LANGUAGE OverloadedStrings #-}

-- |
-- Row 12: two clients of one action server.
module Robots.Clients
  ( twoClients
  ) where

import Control.Monad (replicateM_, void)
import Data.Foldable (traverse_)

import Behavior
import Behavior.Parallel (allOf)
import Behavior.Ros
import Behavior.Ros.Action
import Robots.Campaign
import Robots.Goals

-- | Both have several goals at a time; one cancels many of its own, the other none. (Their links call their goals by
-- the same names.)
twoClients :: Campaign -> Behavior ()
twoClients campaign = withBridge campaign 1 $ \_ way -> withRos way $ \ours -> withRos way $ \theirs -> do
  awaitServers campaign 12 way ["/brief"]
  traverse_ awaitBridge [ours, theirs]
  let sending ros = plainly ros (replacing (fibonacci "/brief"))
      cancelling = do
        instant <- somewhere 0 0.3
        void (interrupted campaign 12 [("client", "ours")] (sleep instant) (sending ours))
      inPeace = uninterrupted campaign 12 [("client", "theirs")] (sending theirs)
      each act = void (allOf (replicate 2 (replicateM_ 250 act)))
  each cancelling `both` each inPeace
