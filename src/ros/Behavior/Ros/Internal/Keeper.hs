{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The threads of a link: one reads, one writes, one asks whether the bridge is there. No user's code runs in them.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Keeper
  ( withRos
  , withRosOptions
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (ErrorCall (..), Exception, catch, finally, throwIO)
import Control.Monad (forever, join, void, when)
import qualified Data.ByteString.Lazy as Bytes
import Data.Foldable (for_, traverse_)
import qualified Data.Map.Strict as Map
import qualified Data.Text as Text
import Prelude hiding (take)

import Behavior (Behavior, Seconds, StoppedWithFault (..), sleep, tryAny, (?))
import Behavior.Internal.Concurrent.Service
import Behavior.Internal.Core.Seconds (duration)
import Behavior.Internal.Spans.Observer (noticed)
import Behavior.Parallel (firstOf, fork, scoped)
import Behavior.Ros.Internal.Frame
import Behavior.Ros.Internal.Link
import Behavior.Ros.Internal.Options
import Behavior.Ros.Internal.Receive
import Behavior.Ros.Internal.Sent
import Behavior.Ros.Internal.Transport
import Behavior.Ros.Internal.UpDown
import Behavior.STM (atomically)
import Behavior.Time (cleanupWithin, now, sleepForever, timeout)
import Behavior.Trace (Change (..), named)

-- $setup
-- >>> import Behavior.Ros
-- >>> import Behavior.Ros.Fake
-- >>> import Behavior.Sim (simulate)
-- >>> import qualified Behavior.Signal as Signal
-- >>> import Control.Monad (void)

-- | Runs a behaviour with a link to a robot.
--
-- > withRos = withRosOptions defaultRosOptions
--
-- It does not wait for a robot that is not there: what is used first waits. When the link is lost, each goal that is
-- awaited and each signal that is watched faults at once with 'Behavior.Ros.LinkLost'; meanwhile it connects again,
-- with growing pauses. Then subscriptions are made again, and goals are /not/ sent again.
--
-- [Result] The behaviour's.
-- [Failure, fault] The behaviour's: thrown. What 'Behavior.Ros.onReport' throws stops the behaviour, and is thrown.
-- [Cancellation] Requests the stop of the behaviour; the link is there until the behaviour has ended, cleanup
--   included: so goals are cancelled, and confirmed.
--
-- However the behaviour ends, what it has published is sent before 'withRos' returns, if the bridge takes it within a
-- second: so a cleanup can publish that the robot is to stand still.
--
-- >>> :{
-- void . simulate . withFakeRobot [] $ \robot -> withRos (fakeRos robot) $ \ros ->
--   Signal.waitUntil (linkUp ros) >> putStrLn "connected"
-- :}
-- connected
--
-- @since 0.1.0.0
withRos :: Transport -> (Ros -> Behavior a) -> Behavior a
withRos = withRosOptions defaultRosOptions

-- | 'withRos' with other options. A duration in them that is negative or NaN is refused with an 'ErrorCall' (a
-- fault), and so is an address that is not allowed ('Behavior.Ros.rosbridge').
--
-- @since 0.1.0.0
withRosOptions :: RosOptions -> Transport -> (Ros -> Behavior a) -> Behavior a
withRosOptions options transport behavior = do
  for_ durations (duration "withRosOptions" . ($ options))
  traverse_ (throwIO . ErrorCall) (refusal transport)
  ending <- newSuffix transport
  ros <- newRos (address transport) ending options
  servedBy (keeping ros transport) (firstOf [behavior ros, reporting ros, tracing ros] `finally` closing ros)
    `finally` atomically (goDown ros "its withRos has ended" >> modifyTVar' (link ros) (\l -> l {isClosed = True}))
 where
  durations = [noServerAfter, patience, tooSlowAfter, pingEvery, pongWithin, firstPause, longestPause]

-- | Has sent what waits to be sent when it returns, if the link is up and the bridge takes it in time.
closing :: Ros -> Behavior ()
closing ros = do
  atomically (modifyTVar' (link ros) (\l -> l {isClosing = True}))
  void (cleanupWithin closeWithin (atomically (readTVar (link ros) >>= check . not . isUp)))

-- | How long it may take to close the connection.
closeWithin :: Seconds
closeWithin = 1

-- | Passes on the lines about what was refused.
reporting :: Ros -> Behavior a
reporting ros = forever (atomically (readTBQueue (reports ros)) >>= onReport (rosOptions ros))

-- | Each goal that nothing waits for, but that may still run, is a span in a trace, until it is known to have ended.
tracing :: Ros -> Behavior a
tracing ros = scoped $ \nursery -> forever $ do
  (n, action) <- atomically (readTQueue (newlyLeft ros))
  fork nursery . named ("may still move: " ++ Text.unpack action) $ do
    noticed "goal" [Change "id" Nothing (Text.unpack n)]
    atomically (readTVar (sent ros) >>= check . Map.notMember n)

-- | Connects, and connects again whenever the link is lost.
keeping :: Ros -> Transport -> Behavior a
keeping ros transport = go (firstPause options)
 where
  options = rosOptions ros
  go pause = do
    began <- now
    why <- connected ros transport
    wasUp <- atomically ((isUp <$> readTVar (link ros)) <* goDown ros why)
    lasted <- subtract began <$> now
    over <- isClosing <$> readTVarIO (link ros)
    when (wasUp && not over) $ noticed "link" [Change "cause" Nothing why, Change "link up" (Just "True") "False"]
    if over then sleepForever else sleep pause
    -- (A bridge that closes each connection at once is not asked ever more often.)
    go (if lasted > longestPause options then firstPause options else min (longestPause options) (2 * pause))

-- | One connection, to its end: why it has ended.
connected :: Ros -> Transport -> Behavior String
connected ros transport = do
  up <- newTVarIO False
  let use connection = do
        time <- now
        first <- atomically (writeTVar up True >> comeUp ros time)
        noticed "link" [Change "link up" (Just "False") "True"]
        -- (A trace shows when the link was there, and why no longer.)
        named ("link: " ++ robot ros) $
          firstOf (map whyItEnds (threads connection first))
            >>= \why -> readTVarIO (link ros) >>= \l -> if isClosing l then pure why else throwIO (LinkEnds why)
      threads connection first =
        [reading ros connection, writing ros connection first, pinging ros connection, settling ros]
      oneConnection = connecting transport (frameBytes (rosOptions ros)) (atomically (receivedAny ros)) use
      tooLong = do
        timeout connectWithin (atomically (readTVar up >>= check)) ? throwIO (LinkEnds "it takes too long to connect")
        sleepForever
  firstOf [whyItEnds oneConnection, whyItEnds tooLong]

-- | Why a link has ended.
newtype LinkEnds = LinkEnds String

instance Show LinkEnds where
  show (LinkEnds why) = why

instance Exception LinkEnds

-- | What it gives, or the exception that ends it. (One that comes while it is stopped says nothing of the behaviour
-- for which there was a link; as a fault it would reach its caller.)
whyItEnds :: Behavior String -> Behavior String
whyItEnds act = (either show id <$> tryAny act) `catch` \(StoppedWithFault stop _) -> throwIO stop

-- | How long it may take to connect.
connectWithin :: Seconds
connectWithin = 5

-- | Anything was received.
receivedAny :: Ros -> STM ()
receivedAny ros = modifyTVar' (received ros) (+ 1)

reading :: Ros -> Connection -> Behavior a
reading ros connection = forever $ do
  frame <- receiveFrame connection
  atomically (receivedAny ros >> writeTVar (isReading ros) True)
  most <- readTVarIO (largestFrame ros)
  let answer = decodeAnswer (Limits most (frameDepth (rosOptions ros))) frame
  time <- either (const (pure 0)) (const now) answer
  atomically $ do
    writeTVar (isReading ros) False
    either (refuse ros) (take ros time (fromIntegral (Bytes.length frame))) answer

-- | Writes these requests first. (A ping and a cancel go before all that wait; the end comes after them.)
writing :: Ros -> Connection -> [Request] -> Behavior a
writing ros connection first = do
  traverse_ write first
  forever . join . atomically $ foldr1 orElse [ping, request cancels, request outgoing, close]
 where
  write = sendFrame connection . encodeRequest
  request queue =
    readTBQueue (queue ros) >>= \next -> case next of
      -- (It may have been withdrawn.)
      SendGoal n _ _ _ -> readTVar (sent ros) >>= maybe (pure (pure ())) (sendGoal next) . Map.lookup n
      _ -> pure (write next)
  sendGoal next known = write next <$ writeTVar (isSent known) True
  ping = sendPing connection <$ (readTVar (pingWanted ros) >>= check >> writeTVar (pingWanted ros) False)
  close = (sendClose connection >> sleepForever) <$ (readTVar (link ros) >>= check . isClosing)

-- | Looks for goals of earlier connections until there are none.
settling :: Ros -> Behavior a
settling ros = do
  sleep (patience (rosOptions ros))
  -- (What was said before the link froze is no longer true.)
  anyCame <- atomically (pinged ros)
  atomically (anyCame >>= check)
  more <- atomically (settle ros)
  if more then settling ros else sleepForever

-- | Asks whether the bridge is there. Anything that comes is an answer, also a part of a frame: one of some megabytes
-- takes seconds on a slow network. (While a frame is being read, answers wait behind it.)
pinging :: Ros -> Connection -> Behavior a
pinging ros connection = forever $ do
  sleep (pingEvery options)
  (anyCame, before) <- atomically ((,) <$> pinged ros <*> bytesCame connection)
  let isThere = or <$> sequence [readTVar (isReading ros), anyCame, (/= before) <$> bytesCame connection]
  timeout (pongWithin options) (atomically (isThere >>= check))
    ? throwIO (LinkEnds ("nothing was received within " ++ show (pongWithin options) ++ " s after a ping"))
 where
  options = rosOptions ros

-- | Sends a ping: whether anything has come since.
pinged :: Ros -> STM (STM Bool)
pinged ros = do
  writeTVar (pingWanted ros) True
  before <- readTVar (received ros)
  pure ((/= before) <$> readTVar (received ros))
