{-# LANGUAGE OverloadedStrings #-}

-- |
-- Row 17: goals of Nav2's action, to a server that has its type and its manners.
module Robots.Navigating
  ( navigating
  ) where

import Control.Monad (replicateM_, void)
import Data.Aeson ((.=))

import Behavior
import Behavior.Ros
import Behavior.Ros.Action
import Behavior.Ros.Messages.Geometry (at)
import Behavior.Ros.Messages.Navigation
import Behavior.STM
import qualified Behavior.Signal as Signal
import Robots.Campaign
import Robots.Goals

-- | Goals that succeed, that are aborted, rejected, stopped and replaced.
navigating :: Campaign -> Behavior ()
navigating campaign = withBridge campaign 1 $ \_ bridge -> do
  awaitReached campaign 17 bridge [("/navigate_to_pose", \ros reach -> driving campaign ros reach (place 1))]
  withRos bridge $ \ros -> do
    awaitBridge ros
    let send kind beside = uninterrupted campaign 17 [("kind", kind)] . driving campaign ros beside
        fails = void . tryAny
    replicateM_ 20 $ do
      send "succeeds" (pure ()) (place 0.1)
      fails $ send "is aborted" (pure ()) (\order -> (place 0.1 order) {behaviorTree = "blocked"})
      fails $ send "is rejected" (pure ()) (\order -> to (at "elsewhere" (fromIntegral order, 0.1) 0))
      begun <- newTVarIO False
      let isDriving = atomically (readTVar begun >>= check)
          begins = atomically (writeTVar begun True)
      _ <- interrupted campaign 17 [("kind", "is stopped")] isDriving (driving campaign ros begins (place 5))
      next <- newTVarIO False
      let isNext = atomically (readTVar next >>= check)
      fails (send "is replaced" (atomically (writeTVar next True)) (place 5))
        `both` (isNext >> send "replaces" (pure ()) (place 0.1))

-- | Drives to the place of an order. The behaviour runs when feedback has come; what was sent, and all feedback, is
-- written.
driving :: Campaign -> Ros -> Behavior () -> (Int -> NavigateToPoseGoal) -> Sending
driving campaign ros beside placeOf order = do
  write ["sent" .= toRos wanted]
  toRos <$> goalWith ros navigate wanted (\feedback -> written feedback Nothing `both` first feedback)
 where
  wanted = placeOf order
  write = note campaign 17 . (("of" .= order) :)
  first feedback = Signal.waitUntil (True <$ feedback) >> beside
  written feedback before = do
    news <- otherThan before (Just <$> feedback)
    write ["feedback" .= fmap toRos news]
    written feedback news
  navigate = replacing (action "/navigate_to_pose") :: Action NavigateToPose

-- | Where a goal with this order drives to, within these seconds.
place :: Double -> Int -> NavigateToPoseGoal
place seconds order = to (at "map" (fromIntegral order, seconds) 0.5)
