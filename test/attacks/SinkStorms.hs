{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Sinks that block for ever or for a while, throw at the mission, run operators and traces of their own, while storms
-- of cancellations go through the operators. Expected: for each sink what it received and what was lost is what
-- happened; the trace ends in time; nothing is left.
module SinkStorms (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM, forM_, replicateM_, unless, void, when)
import Data.IORef
import GHC.Conc (getUncaughtExceptionHandler, setUncaughtExceptionHandler)

import Attack
import Behavior
import Behavior.Parallel (allOf, firstOf, fork, requestStop, scoped)
import Behavior.STM (atomically, newTVarIO, readTVar, writeTVar)
import qualified Behavior.Signal as Signal
import qualified Behavior.Time as Time
import Behavior.Trace

attack :: IO ()
attack = do
  below <- randomBelow 2718
  handler <- getUncaughtExceptionHandler
  forM_ [1 .. 400 :: Int] $ \k -> do
    reports <- newIORef []
    setUncaughtExceptionHandler $ \e ->
      forM_ (fromException e) $ \problem -> atomicModifyIORef' reports (\known -> (problem : known, ()))
    counted <- newIORef (0 :: Int)
    gate <- newEmptyMVar
    flag <- newTVarIO (0 :: Int)
    mission <- newEmptyMVar
    hostile <- forM [1 .. 4 :: Int] $ \_ -> (,,) <$> below 6 <*> below 60 <*> newIORef (0 :: Int)
    limit <- (\i -> [0, 1, 5, 100, 100000] !! i) <$> below 5
    let what = "sink storm " ++ show (k, limit, [(kind, at) | (kind, at, _) <- hostile])
        weight = \case Lost n -> n; _ -> 1
        sinkOf (kind, at, seen) = EachEvent $ \e -> do
          n <- atomicModifyIORef' seen (\n -> (n + weight e, n))
          when (n >= at && n - weight e < at) $ case kind of
            0 -> readMVar gate
            1 -> threadDelay 3000
            2 -> tryReadMVar mission >>= mapM_ (\t -> forkIO (throwTo t (Boom 7)))
            3 ->
              let high = (> 3) <$> Signal.polling 0.0002 (atomically (readTVar flag))
                  task = both (Time.sleep 1) (named "in a sink" (Time.sleep 1))
              in void (Time.timeout 0.001 (Signal.monitor high failed task) ? pure ())
            4 -> withTrace [EachEvent (\_ -> pure ())] (replicateM_ 5 (named "in a trace of a sink" (pure ())))
            _ -> threadDelay 20 >> yield
        leaf name = do
          kind <- below 5
          d <- below 300
          pure . named name $ case kind of
            0 -> threadDelay d
            1 -> failed
            2 -> replicateM_ 30 (named (name ++ " step") (pure ()))
            3 -> Time.sleep 3600 `finally` named (name ++ " cleanup") (pure ())
            _ -> Time.sleep 3600
        tree :: Int -> String -> IO (IO ())
        tree 0 name = leaf name
        tree n name = do
          which <- below 8
          a <- tree (n - 1) (name ++ "a")
          b <- tree (n - 1) (name ++ "b")
          pure . named name $ case which of
            0 -> parallel a b
            1 -> both a b
            2 -> a ? b
            3 -> firstOf [a, b]
            4 -> void (allOf [a, b])
            5 -> scoped (\nursery -> fork nursery a >>= \c -> b `finally` requestStop c)
            6 -> void (Time.timeout 0.0004 a) ? b
            _ -> Signal.switch (Signal.named "flag" (Signal.watching (readTVar flag))) (\i -> if odd i then a else b)
    program <- below 5 >>= \depth -> tree depth "r"
    wait <- below 4000
    changing <- forkIO (forM_ [1 ..] (\i -> atomically (writeTVar flag i) >> threadDelay 100))
    let throwing t = threadDelay wait >> replicateM_ 3 (throwTo t ThreadKilled >> threadDelay 200)
        storm t = putMVar mission t >> void (forkIO (throwing t))
        counts = EachEvent (\e -> modifyIORef' counted (+ weight e))
    _ <- endsWithin 5000 what storm $
      withTraceOptions defaultTraceOptions {queueLimit = 1000000, waitAtEnd = 5} [counts] $
        withTraceOptions defaultTraceOptions {queueLimit = limit, waitAtEnd = 0.05} (map sinkOf hostile) program
    killThread changing
    produced <- readIORef counted
    -- (A sink may still be on its way.)
    left <- (\known -> sum [n | SinkLeft _ n <- known]) <$> readIORef reports
    received <- sum <$> mapM (\(_, _, seen) -> readIORef seen) hostile
    thrown <- length . filter (\case SinkThrew _ -> True; _ -> False) <$> readIORef reports
    promise
      (what ++ ": " ++ show received ++ " received or lost, " ++ show left ++ " left of 4 times " ++ show produced)
      (received + left == 4 * produced && thrown == 0)
    putMVar gate ()
    noThreads what
  setUncaughtExceptionHandler handler

noThreads :: String -> IO ()
noThreads what = go (5000 :: Int)
 where
  go n = liveThreadCount >>= \left -> unless (left == 0) $ do
    when (n == 0) . void $ broken (what ++ ": " ++ show left ++ " threads were left")
    threadDelay 1000 >> go (n - 1)
