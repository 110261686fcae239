{-# LANGUAGE ScopedTypeVariables #-}

-- | Many operators at once wait for slow cleanups, side by side and deeply nested. Expected: no
-- processor time while they wait (promise 10), and no memory and no thread is left.
module SlowStops (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (replicateM, replicateM_, void)
import Data.List (intercalate)
import GHC.Clock (getMonotonicTime)
import GHC.Stats
import System.CPUTime (getCPUTime)
import System.Mem (performMajorGC)

import Attack
import Behavior

attack :: IO ()
attack = do
  alone <- sideBySide "20,000 side by side, waited for without the library" (\gate -> do
    box <- newEmptyMVar
    _ <- forkIO (uninterruptibleMask_ (readMVar gate) `finally` putMVar box ())
    uninterruptibleMask_ (takeMVar box))
  let waits gate = mask_ (parallel (milliseconds 3600000 `finally` uninterruptibleMask_ (readMVar gate)) (pure ()))
  beside <- sideBySide "20,000 side by side" waits
  one <- waiting "one alone" $ \gate -> do
    done <- newEmptyMVar
    _ <- forkIO (waits gate `finally` putMVar done ())
    pure (takeMVar done)
  nested <- waiting "1,500 one inside the other" $ \gate -> do
    let nest :: Int -> IO ()
        nest 0 = milliseconds 3600000 `finally` uninterruptibleMask_ (readMVar gate)
        nest n = both (nest (n - 1)) (milliseconds 3600000)
    done <- newEmptyMVar
    t <- forkIO (mask_ (nest 1500 `catch` \(_ :: SomeException) -> pure ()) `finally` putMVar done ())
    milliseconds 1500
    void (forkIO (killThread t))
    milliseconds 1000
    pure (takeMVar done)
  -- And many, one after the other.
  let slowStop = mask_ (parallel (milliseconds 3600000 `finally` uninterruptibleMask_ (threadDelay 50)) (pure ()))
  replicateM_ 2000 slowStop
  before <- resident
  replicateM_ 5000 slowStop
  after <- resident
  promise ("memory " ++ show (before, after)) (after < before + 1000000)
  putStrLn ("memory before and after 5,000 slow stops " ++ show (before, after))
  let spinning = alone ++ one ++ beside ++ nested
  promise (intercalate "; " spinning) (null spinning)
 where
  sideBySide what one = waiting what $ \gate -> do
    ends <- replicateM 20000 $ do
      done <- newEmptyMVar
      _ <- forkIO (one gate `finally` putMVar done ())
      pure done
    pure (mapM_ takeMVar ends)
  waiting what begin = do
    gate <- newEmptyMVar
    finish <- begin gate
    milliseconds 2000
    (cpu, wall) <- (,) <$> getCPUTime <*> getMonotonicTime
    milliseconds 3000
    (cpuAfter, wallAfter) <- (,) <$> getCPUTime <*> getMonotonicTime
    let share = fromIntegral (cpuAfter - cpu) / 1e12 / (wallAfter - wall) :: Double
    putStrLn (what ++ ": " ++ show share ++ " of a processor while all wait")
    putMVar gate ()
    _ <- inThread 20000 what finish
    n <- liveThreadCount
    promise (what ++ ": " ++ show n ++ " threads were left") (n == 0)
    pure [what ++ ": they used " ++ show share ++ " of a processor while they waited" | share >= 0.1]
  resident = performMajorGC >> gcdetails_live_bytes . gc <$> getRTSStats
