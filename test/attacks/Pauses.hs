-- | Cancellations at random moments of what pauses, holds a semaphore, keeps progress by key, and awaits
-- agreement. Expected: a pause that has begun is followed by its end, and no two of them run at once; all
-- units come back; no step whose commit is masked is repeated or left out; results agree; no thread is left.
module Pauses (attack) where

import Control.Concurrent (yield)
import Control.Concurrent.Async (async, cancel, waitCatch, withAsync)
import Control.Exception
import Control.Monad (forM_, replicateM, replicateM_, when)
import Data.Bits (shiftR)
import Data.IORef
import qualified Data.Map.Strict as Map

import Attack
import Behavior
import Behavior.Parallel (agreeing)
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Time (sleepForever, timeout)

attack :: IO ()
attack = do
  random <- newIORef 7
  forM_ [pausing, holding, goingOn, agreement] $ \storm -> replicateM_ 2000 $ do
    storm (below random)
    n <- liveThreadCount
    promise (show n ++ " threads were left") (n == 0)

-- | A random number below the given one. (The generator is Knuth's for MMIX.)
type Below = Int -> IO Int

below :: IORef Int -> Below
below state n = atomicModifyIORef' state $ \s ->
  let next = s * 6364136223846793005 + 1442695040888963407 in (next, (next `shiftR` 33) `mod` n)

-- | Takes a random time, and can be interrupted.
busy :: Below -> Int -> IO ()
busy random most = do
  n <- random most
  replicateM_ n (atomically (pure ()))
  when (n `mod` 4 == 0) yield

-- | Runs it in a thread, which is mostly cancelled at a random moment.
hurt :: Below -> IO a -> IO (Either SomeException a)
hurt random act = do
  running <- async act
  busy random 60
  spared <- random 3
  when (spared > 0) (cancel running)
  waitCatch running

-- | Counts in the variable how many are inside; gives how many, this one included.
inside :: IORef Int -> (Int -> IO a) -> IO a
inside variable = bracket (change 1) (\_ -> change (-1))
 where
  change k = atomicModifyIORef' variable (\n -> (n + k, n + k))

pausing :: Below -> IO ()
pausing random = do
  near <- newTVarIO False
  counts <- newIORef (0 :: Int, 0 :: Int)
  current <- newIORef 0
  failing <- random 6
  let alone act = inside current (\n -> promise "a pause and a resume, or two of one, at once" (n == 1) >> act)
      pause = alone $ do
        atomicModifyIORef' counts (\(p, r) -> ((p + 1, r), ()))
        busy random 10
        when (failing == 0) failed
      resume = alone (atomicModifyIORef' counts (\(p, r) -> ((p, r + 1), ())) >> busy random 5)
      person = forM_ (cycle [True, False]) $ \there -> atomically (writeTVar near there) >> busy random 15
  withAsync person $ \_ -> do
    let task = replicateM_ 5 (busy random 20)
    _ <- hurt random (Signal.pausedWhile (Signal.watching (readTVar near)) pause resume task)
    (paused, resumed) <- readIORef counts
    promise (show paused ++ " pauses began, and only " ++ show resumed ++ " times it resumed") (resumed >= paused)

holding :: Below -> IO ()
holding random = do
  units <- (+ 1) <$> random 3
  semaphore <- atomically (newTSem (fromIntegral units))
  current <- newIORef 0
  let use = withTSem semaphore . inside current $ \n -> do
        promise (show n ++ " hold one of " ++ show units ++ " units") (n <= units)
        busy random 10
        fails <- random 3
        when (fails == 0) failed
  robots <- replicateM 5 (async (hurt random use))
  mapM_ waitCatch robots
  end <- inThread 5000 "taking all units again" (replicateM_ units (atomically (waitTSem semaphore)))
  promise "a unit is lost" (either (const False) (const True) end)

goingOn :: Below -> IO ()
goingOn random = do
  progress <- newTVarIO Map.empty
  done <- newIORef Map.empty
  let carryOut order step = do
        busy random 8
        fails <- random 6
        when (fails == 0) failed
        atomicModifyIORef' done (\known -> (Map.insertWith (+) (order, step) (1 :: Int) known, ()))
      serve order = mask_ (resumableFor progress order [1 .. 4 :: Int] (interruptibly . carryOut order) >>= atomically)
      -- (What it has done must be the last step, and masked; so it can be interrupted only before that.)
      interruptibly act = busy random 3 >> allowInterrupt >> act
      untilServed order = hurt random (serve order) >>= either (const (untilServed order)) pure
  mapM_ untilServed [1 .. 3 :: Int]
  steps <- readIORef done
  promise ("the steps were done so often: " ++ show steps) (Map.elems steps == replicate 12 1)
  left <- readTVarIO progress
  promise "keys are left" (Map.null left)

agreement :: Below -> IO ()
agreement random = do
  n <- random 7
  m <- random 5
  current <- newIORef 0
  let sensor k = inside current $ \_ -> do
        busy random 10
        how <- random 5
        case how of
          0 -> failed
          1 -> sleepForever
          _ -> pure ((k + how) `mod` 2)
  end <- hurt random (timeout 0.002 (agreeing m (==) (map sensor [1 .. n])))
  running <- readIORef current
  promise "a sensor is left" (running == 0)
  forM_ end $ \results ->
    promise
      ("not " ++ show m ++ " that agree: " ++ show results)
      (length results == m && and (zipWith (==) results (drop 1 results)))
