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
import Robots.Goals
import Robots.Stage

-- | Killed in mid-goal, and while a goal is being cancelled.
killed :: Stage -> Behavior ()
killed stage = withBridge stage 9090 $ \bridge way -> withRos way $ \ros -> do
  let again kind server strike = do
        awaitServers stage 5 way [server]
        awaitBridge ros
        () <- strike stage 5 kind ros (fibonacci server) (signalBridge sigKILL bridge)
        endBridge sigKILL bridge
        startBridge stage bridge
  replicateM_ (if isLong stage then 100 else 30) (again "in mid-goal" "/steady" inMidGoal)
  replicateM_ (if isLong stage then 30 else 10) (again "during a cancel" "/stubborn" duringCancel)
  within 10 "the end of the goals, as the program sees it" ((== 0) <$> movingGoals ros)

-- | Half-open: the bridge is there, and is silent.
halfOpen :: Stage -> Behavior ()
halfOpen stage = withBridge stage 9090 $ \bridge way ->
  withRosWith defaultRosOptions {pingEvery = 0.5, pongWithin = 0.5} way $ \ros -> do
    awaitServers stage 6 way ["/steady"]
    replicateM_ (if isLong stage then 30 else 6) $ do
      awaitBridge ros
      inMidGoal stage 6 "in mid-goal" ros (fibonacci "/steady") (signalBridge sigSTOP bridge)
      signalBridge sigCONT bridge

-- | Strikes while the server works on a goal; or while it is being cancelled, which that server never confirms. What is
-- thrown is only written.
inMidGoal, duringCancel :: Stage -> Row -> String -> Ros -> Action Value -> IO () -> Behavior ()
inMidGoal stage row kind ros which strike =
  struck stage row kind ros strike $ \order strikeNow -> do
    stopAt <- newIORef Nothing
    let beside = somewhere 0 0.1 >>= sleep >> strikeNow
    believing stage row [("kind", kind)] order stopAt (untilFeedback ros (replacing which) beside)
duringCancel stage row kind ros which strike =
  struck stage row kind ros strike $ \order strikeNow -> do
    stopAt <- newIORef Nothing
    requested <- newTVarIO False
    let cancel = do
          sleep 0.2
          clock >>= writeIORef stopAt . Just
          atomically (writeTVar requested True)
        sending = plainly ros (replacing which)
    firstOf [believing stage row [("kind", kind)] order stopAt sending, cancel]
      `both` (atomically (readTVar requested >>= check) >> somewhere 0 0.3 >>= sleep >> strikeNow)

-- | Gives the behaviour an order, and what strikes; then writes what it has thrown, and how often a cleanup has run.
struck :: Stage -> Row -> String -> Ros -> IO () -> (Int -> IO () -> Behavior ()) -> Behavior ()
struck stage row kind ros strike behavior = do
  order <- newOrder stage
  struckAt <- newIORef Nothing
  cleanups <- newIORef (0 :: Int)
  let strikeNow = clock >>= writeIORef struckAt . Just >> strike
  how <- tryAny (timeout 30 (behavior order strikeNow `finally` modifyIORef' cleanups (+ 1)))
  ended <- clock
  moving <- Signal.read (movingGoals ros)
  at <- readIORef struckAt
  ran <- readIORef cleanups
  note stage row
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
restarted :: Stage -> Behavior ()
restarted stage =
  withBridge stage 9090 $ \bridge way -> withBridge stage 9091 $ \_ otherWay ->
    withRos way $ \ros -> withRos otherWay $ \other ->
      for_ (if isLong stage then [1 .. 30] else [1 .. 6 :: Int]) $ \n -> do
        for_ [way, otherWay] $ \each -> awaitServers stage 7 each ["/steady"]
        for_ [ros, other] awaitBridge
        let ticks = latest ros (topic "/ticks" (atLeastEvery 10)) :: Signal.Signal (Std Int32)
        _ <- Signal.read ticks
        uninterrupted stage 7 [("kind", "other client")] (plainly other (fibonacci "/steady")) `both` do
          let (kind, signal) = if even n then ("killed", sigKILL) else ("ended", sigTERM)
          inMidGoal stage 7 kind ros (fibonacci "/steady") (signalBridge signal bridge)
          endBridge signal bridge
          startBridge stage bridge
          begun <- clock
          _ <- Signal.read ticks
          ended <- clock
          note stage 7 ["subscribed again after" .= (ended - begun)]
          awaitServers stage 7 way ["/steady"]
          tryAgain ros (100 :: Int)
 where
  tryAgain ros n = do
    begun <- newTVarIO False
    let sending = untilFeedback ros (fibonacci "/steady") (atomically (writeTVar begun True))
    stopped <- interrupted stage 7 [("kind", "again")] (atomically (readTVar begun >>= check)) sending
    if n == 0 then failWith "no goal was accepted again" else pure ()
    unless (isJust stopped) $ sleep 0.1 >> tryAgain ros (n - 1)

-- | Two robots, each with its bridge and mission; the bridge of one dies, again and again.
twoRobots :: Stage -> Behavior ()
twoRobots stage =
  withBridge stage 9090 $ \bridge way -> withBridge stage 9091 $ \_ otherWay ->
    withRos way $ \ros -> withRos otherWay $ \other -> do
      awaitServers stage 13 otherWay ["/brief"]
      let n = if isLong stage then 30 else 10
          unaffected = uninterrupted stage 13 [("kind", "other robot")] (plainly other (fibonacci "/brief"))
          affected = do
            awaitServers stage 13 way ["/steady"]
            awaitBridge ros
            inMidGoal stage 13 "dying" ros (fibonacci "/steady") (signalBridge sigKILL bridge)
            endBridge sigKILL bridge
            startBridge stage bridge
      over <- newTVarIO False
      let mission = unaffected >> readTVarIO over >>= \isOver -> unless isOver mission
      mission `both` (replicateM_ n affected >> atomically (writeTVar over True))
