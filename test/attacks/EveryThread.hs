{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Exceptions of all types, stop requests of other threads among them, are thrown at every thread that users' code
-- runs in: branches, recoveries, sensors, handlers, views. Expected: each random program ends, nothing is
-- left, no recovery overlaps its task, and a second recovery or task never begins before the first has ended.
module EveryThread (attack) where

import Control.Concurrent
import Control.Exception
import Control.Exception.Base (nonTermination)
import Control.Monad (forM_, forever, replicateM, unless, void, when)
import Data.IORef
import System.Exit (ExitCode (..))

import Attack
import Behavior
import Behavior.Message (onMessage, withInbox)
import Behavior.Parallel (allOf, decide, firstOf, fork, requestStop, scoped)
import Behavior.STM (atomically, newTVarIO, readTVar, writeTVar)
import qualified Behavior.Signal as Signal
import qualified Behavior.Time as Time
import Behavior.Trace (Sink (..), named, withTrace)

attack :: IO ()
attack = do
  below <- randomBelow 31337
  forM_ [1 .. 1500 :: Int] $ \k -> do
    threads <- newIORef ([] :: [ThreadId])
    caught <- newIORef ([] :: [SomeException])
    overlaps <- newIORef (0 :: Int)
    flag <- newTVarIO (0 :: Int)
    let what = "every thread, " ++ show k
        -- In what users' code runs in, its thread can be found.
        here act = myThreadId >>= add threads >> act
        leaf = do
          d <- below 500
          kind <- below 5
          pure . here $ case kind of
            0 -> threadDelay d
            1 -> threadDelay d >> failed
            2 -> Time.sleep 3600 `finally` uninterruptibleMask_ (threadDelay d)
            -- Its stop request is thrown at others, too.
            _ -> Time.sleep 3600 `catch` \(e :: SomeException) -> add caught e >> throwIO e
        never act = do
          running <- newIORef (0 :: Int)
          let alone = bracket_ (bump running 1 >>= \n -> when (n > 0) (void (bump overlaps 1))) (bump running (-1))
          pure (act alone)
        tree :: Int -> IO (IO ())
        tree 0 = leaf
        tree n = do
          which <- below 13
          a <- here <$> tree (n - 1)
          b <- here <$> tree (n - 1)
          let odds = Signal.polling 0.0003 (here (odd <$> atomically (readTVar flag)))
              watched = odd <$> Signal.watching (readTVar flag)
          case which of
            0 -> pure (parallel a b)
            1 -> pure (both a b)
            2 -> pure (a ? b)
            3 -> pure (firstOf [a, b])
            4 -> pure (void (allOf [a, b]))
            5 -> pure . scoped $ \nursery -> do
              c <- fork nursery a
              _ <- fork nursery b
              Time.sleep 0.0005 >> requestStop c
            6 -> never (\alone -> Signal.monitor odds (alone a) (alone b))
            7 -> never (\alone -> Signal.rSelect watched (alone a) (alone b))
            8 -> pure (void (Time.timeout 0.0007 a) ? b)
            9 -> never $ \alone ->
              Signal.withShared (Signal.debounce 0.0001 odds) (\s -> Signal.switch s (\i -> alone (if i then a else b)))
            10 ->
              let delivers deliver = here (forever (deliver () >> Time.sleep 0.0006))
              in pure (withInbox 3 delivers (\inbox -> onMessage inbox (\() -> pure () <$ a) b))
            11 -> pure (decide (\ends -> if null [() | Nothing <- ends] then Just (pure ()) else Nothing) [a, b])
            _ ->
              let traced = named "traced" (a `finally` Time.cleanupWithin 0.0005 (b ? pure ()))
              in pure (withTrace [EachEvent (\_ -> here (pure ()))] traced)
        thrower = forever $ do
          known <- readIORef threads
          stops <- readIORef caught
          unless (null known) $ do
            target <- (known !!) <$> below (length known)
            which <- below (length exceptions + length stops)
            _ <- forkIO (throwTo target ((exceptions ++ stops) !! which))
            pure ()
          below 100 >>= threadDelay
    program <- below 5 >>= tree
    changing <- forkIO (forM_ [1 ..] (\i -> atomically (writeTVar flag i) >> threadDelay 200))
    throwers <- replicateM 2 (forkIO thrower)
    wait <- below 4000
    killer <- newEmptyMVar
    let killing t = do
          threadDelay wait >> mapM_ killThread throwers
          forever (throwTo t ThreadKilled >> threadDelay 20000)
        atEnd t = forkIO (killing t) >>= putMVar killer
    _ <- endsWithin 20000 what atEnd program
    takeMVar killer >>= killThread
    killThread changing
    noThreads what
    n <- readIORef overlaps
    promise (what ++ ": " ++ show n ++ " branches ran beside each other") (n == 0)
 where
  add :: IORef [a] -> a -> IO ()
  add list a = atomicModifyIORef' list (\as -> (a : as, ()))
  bump r i = atomicModifyIORef' r (\n -> (n + i, n))
  exceptions =
    [ toException (Boom 1)
    , toException ThreadKilled
    , toException StackOverflow
    , toException (ExitFailure 3)
    , toException BlockedIndefinitelyOnSTM
    , toException BlockedIndefinitelyOnMVar
    , nonTermination
    , toException Failed
    , toException (StoppedWithFault (toException ThreadKilled) (toException (Boom 2)))
    , toException (ErrorCall undefined)
    , undefined
    ]

noThreads :: String -> IO ()
noThreads what = go (5000 :: Int)
 where
  go n = liveThreadCount >>= \left -> unless (left == 0) $ do
    when (n == 0) . void $ broken (what ++ ": " ++ show left ++ " threads were left")
    threadDelay 1000 >> go (n - 1)
