{-# LANGUAGE OverloadedStrings #-}

-- |
-- Rows 5, 6, 7 and 13: bridges that are killed, stopped and started again.
module Robots.Losing
  ( killed
  , halfOpen
  , restarted
  , twoRobots
  ) where

import Control.Exception (displayException, finally)
import Control.Monad (replicateM_, unless)
import Data.Aeson (Value, (.=))
import Data.Foldable (for_)
import Data.IORef
import Data.Int (Int32)
import Data.Maybe (isJust)
import System.Posix.Signals (sigCONT, sigKILL, sigSTOP, sigTERM)

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Action
import Behavior.Ros.Messages
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Time (timeout)
import Robots.Campaign
import Robots.Goals

-- | Killed in mid-goal, and while a goal is being cancelled.
killed :: Campaign -> Behavior ()
killed campaign = withBridge campaign 1 $ \bridge way -> withRos way $ \ros -> do
  let again kind server strike = do
        awaitServers campaign 5 way [server]
        awaitBridge ros
        () <- strike campaign 5 kind ros (fibonacci server) (signalBridge sigKILL bridge)
        endBridge sigKILL bridge
        startBridge campaign bridge
  replicateM_ (if isLong campaign then 100 else 30) (again "in mid-goal" "/steady" inMidGoal)
  replicateM_ (if isLong campaign then 30 else 10) (again "during a cancel" "/stubborn" duringCancel)
  within 10 "the end of the goals, as the program sees it" ((== 0) <$> movingGoals ros)

-- | Half-open: the bridge is there, and is silent.
halfOpen :: Campaign -> Behavior ()
halfOpen campaign = withBridge campaign 1 $ \bridge way ->
  withRosOptions defaultRosOptions {pingEvery = 0.5, pongWithin = 0.5} way $ \ros -> do
    awaitServers campaign 6 way ["/steady"]
    replicateM_ (if isLong campaign then 30 else 6) $ do
      awaitBridge ros
      inMidGoal campaign 6 "in mid-goal" ros (fibonacci "/steady") (signalBridge sigSTOP bridge)
      signalBridge sigCONT bridge

-- | Strikes while the server works on a goal; or while it is being cancelled, which that server never confirms. What is
-- thrown is only written.
inMidGoal, duringCancel :: Campaign -> Row -> String -> Ros -> Action Value -> IO () -> Behavior ()
inMidGoal campaign row kind ros which strike =
  struck campaign row kind ros strike $ \order strikeNow -> do
    stopAt <- newIORef Nothing
    let beside = somewhere 0 0.1 >>= sleep >> strikeNow
    believing campaign row [("kind", kind)] order stopAt (untilFeedback ros (replacing which) beside)
duringCancel campaign row kind ros which strike =
  struck campaign row kind ros strike $ \order strikeNow -> do
    stopAt <- newIORef Nothing
    requested <- newTVarIO False
    let cancel = do
          sleep 0.2
          clock >>= writeIORef stopAt . Just
          atomically (writeTVar requested True)
        sending = plainly ros (replacing which)
    firstOf [believing campaign row [("kind", kind)] order stopAt sending, cancel]
      `both` (atomically (readTVar requested >>= check) >> somewhere 0 0.3 >>= sleep >> strikeNow)

-- | Gives the behaviour an order, and what strikes; then writes what it has thrown, and how often a cleanup has run.
struck :: Campaign -> Row -> String -> Ros -> IO () -> (Int -> IO () -> Behavior ()) -> Behavior ()
struck campaign row kind ros strike behavior = do
  order <- newOrder campaign
  struckAt <- newIORef Nothing
  cleanups <- newIORef (0 :: Int)
  let strikeNow = clock >>= writeIORef struckAt . Just >> strike
  how <- tryAny (timeout 30 (behavior order strikeNow `finally` modifyIORef' cleanups (+ 1)))
  ended <- clock
  moving <- Signal.read (movingGoals ros)
  at <- readIORef struckAt
  ran <- readIORef cleanups
  note campaign row
    [ "of" .= order
    , "kind" .= kind
    , "struck" .= at
    , "ended" .= ended
    , "thrown" .= either displayException (const "nothing") how
    , "cleanups" .= ran
    , "moving" .= moving
    ]

-- | The bridge is killed, or ended, in mid-goal, and started again, while another client has a goal over another
-- bridge.
restarted :: Campaign -> Behavior ()
restarted campaign =
  withBridge campaign 1 $ \bridge way -> withBridge campaign 2 $ \_ otherWay ->
    withRos way $ \ros -> withRos otherWay $ \other ->
      for_ (if isLong campaign then [1 .. 30] else [1 .. 6 :: Int]) $ \n -> do
        for_ [way, otherWay] $ \each -> awaitServers campaign 7 each ["/steady"]
        for_ [ros, other] awaitBridge
        let ticks = latest ros (topic "/ticks" (atLeastEvery 10)) :: Signal.Signal (Std Int32)
        _ <- Signal.read ticks
        uninterrupted campaign 7 [("kind", "other client")] (plainly other (fibonacci "/steady")) `both` do
          let (kind, signal) = if even n then ("killed", sigKILL) else ("ended", sigTERM)
          inMidGoal campaign 7 kind ros (fibonacci "/steady") (signalBridge signal bridge)
          endBridge signal bridge
          startBridge campaign bridge
          begun <- clock
          _ <- Signal.read ticks
          ended <- clock
          note campaign 7 ["subscribed again after" .= (ended - begun)]
          awaitServers campaign 7 way ["/steady"]
          tryAgain ros (100 :: Int)
 where
  tryAgain ros n = do
    begun <- newTVarIO False
    let sending = untilFeedback ros (fibonacci "/steady") (atomically (writeTVar begun True))
    stopped <- interrupted campaign 7 [("kind", "again")] (atomically (readTVar begun >>= check)) sending
    if n == 0 then failWith "no goal was accepted again" else pure ()
    unless (isJust stopped) $ sleep 0.1 >> tryAgain ros (n - 1)

-- | Two robots, each with its bridge and mission; the bridge of one dies, again and again.
twoRobots :: Campaign -> Behavior ()
twoRobots campaign =
  withBridge campaign 1 $ \bridge way -> withBridge campaign 2 $ \_ otherWay ->
    withRos way $ \ros -> withRos otherWay $ \other -> do
      awaitServers campaign 13 otherWay ["/brief"]
      let n = if isLong campaign then 30 else 10
          unaffected = uninterrupted campaign 13 [("kind", "other robot")] (plainly other (fibonacci "/brief"))
          affected = do
            awaitServers campaign 13 way ["/steady"]
            awaitBridge ros
            inMidGoal campaign 13 "dying" ros (fibonacci "/steady") (signalBridge sigKILL bridge)
            endBridge sigKILL bridge
            startBridge campaign bridge
      over <- newTVarIO False
      let mission = unaffected >> readTVarIO over >>= \isOver -> unless isOver mission
      mission `both` (replicateM_ n affected >> atomically (writeTVar over True))
