{-# LANGUAGE BangPatterns #-}

-- | Simulated runs end in a deadlock, while another thread computes and does not allocate.
-- Expected: each is reported as a deadlock, and not as blocked outside of the simulation.
module SimBusy (attack) where

import Control.Concurrent
import Control.Concurrent.STM (check, newTVarIO, readTVar)
import Control.Exception (evaluate)
import Control.Monad (forM_, unless, void)
import Data.IORef
import GHC.Clock (getMonotonicTime)

import Attack
import Behavior.STM (atomically)
import Behavior.Sim

attack :: IO ()
attack = do
  before <- getMonotonicTime
  _ <- evaluate (computed 100000000 1)
  after <- getMonotonicTime
  over <- newIORef False
  let computing = do
        _ <- evaluate (computed (round (0.8 * 100000000 / (after - before))) 1)
        yield
        isOver <- readIORef over
        unless isOver computing
  done <- newEmptyMVar
  -- All on one capability: if there is another, the watchdog runs on that one.
  void . forkOn 0 $ do
    void (forkOn 0 computing)
    forM_ [1 .. 3 :: Int] $ \k -> do
      never <- newTVarIO False
      run <- simulate (atomically (readTVar never >>= check))
      case outcome run of
        Deadlock _ -> pure ()
        other -> broken ("run " ++ show k ++ ": " ++ explain other)
    writeIORef over True
    putMVar done ()
  takeMVar done

computed :: Int -> Int -> Int
computed 0 !sofar = sofar
computed n !sofar = computed (n - 1) (sofar * 3 + n)
{-# NOINLINE computed #-}
