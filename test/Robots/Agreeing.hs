{-# LANGUAGE OverloadedStrings #-}

-- |
-- Row 16: the cases of fake robots ("Ros.Cases") with real servers and a real bridge.
module Robots.Agreeing
  ( agreeing
  ) where

import Control.Exception (displayException)
import Data.Aeson ((.=))
import Data.Foldable (for_)
import System.Posix.Signals (sigKILL)

import Behavior
import Behavior.Ros
import Behavior.Time (timeout)
import Robots.Campaign
import Robots.Goals
import Ros.Cases

agreeing :: Campaign -> Behavior ()
agreeing campaign = withBridge campaign 1 $ \bridge way -> do
  awaitServers campaign 16 way ["/fast", "/stubborn", "/steady", "/brief", "/picky"]
  for_ cases $ \it -> do
    let host ros = Host ros (endBridge sigKILL bridge) (startBridge campaign bridge)
    gave <- tryAny (timeout 20 (withRosOptions impatient {patience = 2} way (mission it . host)))
    note campaign 16 ["case" .= title it, "gave" .= either (pure . displayException) id gave, "expected" .= outcome it]
