-- |
-- In a trace, a stop comes in the moment in which an operator that reacts has just stopped its own branch. Expected:
-- it is received, and the operator ends.
module TracedStops (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM_, replicateM_, void)
import Data.IORef

import Attack
import Behavior
import Behavior.STM (atomically, newTVarIO, readTVar, writeTVar)
import qualified Behavior.Signal as Signal
import Behavior.Trace

attack :: IO ()
attack =
  forM_ [1 .. 8000 :: Int] $ \k -> do
    flag <- newTVarIO False
    spun <- newIORef (0 :: Int)
    begun <- newEmptyMVar
    let spin n = replicateM_ n (modifyIORef' spun (+ 1))
        reacting = Signal.switch (Signal.watching (readTVar flag)) (\_ -> tryPutMVar begun () >> milliseconds 3600000)
        -- (The factor spreads the moments; they are the same in every run.)
        winner = takeMVar begun >> atomically (writeTVar flag True) >> spin (k * 7 `mod` 400)
    void . inThread 5000 ("round " ++ show k) . withTrace [] $
      if even k then parallel reacting winner else withThread reacting winner
 where
  -- As a program does that uses no operator: the reacting one is killed.
  withThread reacting winner = do
    ended <- newEmptyMVar
    killed <- adopt >>= \here -> forkIO (here reacting `finally` putMVar ended ())
    () <- winner
    killThread killed
    takeMVar ended
