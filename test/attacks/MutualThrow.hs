-- | A branch that is just being stopped throws to the operator's caller, on two capabilities
-- at the same moment. Expected: both are received, nothing hangs, no thread is left.
module MutualThrow (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM_, replicateM_, void)
import Data.IORef

import Attack
import Behavior
import qualified Behavior.Signal as Signal

attack :: IO ()
attack =
  forM_ [1 .. 4000 :: Int] $ \k -> do
    stopped <- newIORef False
    end <- inThread 5000 ("round " ++ show k) $ do
      me <- myThreadId
      spun <- newIORef (0 :: Int)
      started <- newEmptyMVar
      let spin n = replicateM_ n (modifyIORef' spun (+ 1))
          -- It throws before its stop is requested, at the same moment, or in its cleanup. (The factors spread the
          -- moments; they are the same in every run.)
          throwing =
            (tryPutMVar started () >> yield >> spin (k * 7 `mod` 900) >> throwTo me (Boom k) >> milliseconds 3600000)
              `onException` writeIORef stopped True
          winner = takeMVar started >> spin (k * 11 `mod` 900)
      case k `mod` 3 of
        0 -> parallel throwing winner
        1 -> parallel throwing (parallel (throwing `finally` pure ()) winner)
        _ -> void (Signal.whileHolding (pure True) (parallel throwing winner))
    wasStopped <- readIORef stopped
    promise ("round " ++ show k ++ ": the branch was not stopped") wasStopped
    case end of
      Right () -> pure ()
      Left e -> promise ("round " ++ show k ++ ": " ++ show e) (fromException e == Just (Boom k))
    n <- liveThreadCount
    promise ("round " ++ show k ++ ": " ++ show n ++ " threads were left") (n == 0)
