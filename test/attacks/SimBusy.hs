-- | Attacks: a simulated run that ends in a deadlock, while the process has other things to do. Must
-- come out: it is reported as the deadlock that it is, and not as a wait outside of the simulation.
module SimBusy (attack) where

import Control.Concurrent
import Control.Concurrent.STM (check, newTVarIO, readTVar)
import Control.Monad (forM_, forever, replicateM, when)
import Data.IORef

import Attack
import Behavior.Sim
import Behavior.STM (atomically)

attack :: IO ()
attack = do
  busy <- replicateM 12 . forkOn 0 $ do
    count <- newIORef (0 :: Int)
    forever (modifyIORef' count (+ 1) >> readIORef count >>= \n -> when (n < 0) (print n))
  done <- newEmptyMVar
  -- (On the same capability: where there is another, the watchdog is there, and undisturbed.)
  _ <- forkOn 0 $ do
    forM_ [1 .. 3 :: Int] $ \k -> do
      never <- newTVarIO False
      run <- simulate (atomically (readTVar never >>= check))
      case outcome run of
        Deadlock _ -> pure ()
        other -> broken ("run " ++ show k ++ ": " ++ explain other)
    putMVar done ()
  takeMVar done
  mapM_ killThread busy
