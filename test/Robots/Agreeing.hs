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
import Robots.Goals
import Robots.Stage
import Ros.Cases

agreeing :: Stage -> Behavior ()
agreeing stage = withBridge stage 9090 $ \bridge way -> do
  awaitServers stage 16 way ["/fast", "/stubborn", "/steady", "/brief", "/picky"]
  for_ cases $ \it -> do
    let host ros = Host ros (endBridge sigKILL bridge) (startBridge stage bridge)
    gave <- tryAny (timeout 20 (withRosWith impatient {patience = 2} way (mission it . host)))
    note stage 16 ["case" .= title it, "gave" .= either (pure . displayException) id gave, "expected" .= outcome it]
