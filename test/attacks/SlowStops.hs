-- | Attacks: many operators at once that wait for slow cleanups, and deep nests of them. Must come
-- out: no processor time while they wait (promise 10), no memory and no thread after.
module SlowStops (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM_, replicateM, void)
import System.CPUTime (getCPUTime)
import GHC.Clock (getMonotonicTime)

import Attack
import Behavior

attack :: IO ()
attack = do
  sideBySide "20,000 side by side, waited for without the library" (\gate -> do
    box <- newEmptyMVar
    _ <- forkIO (uninterruptibleMask_ (readMVar gate) `finally` putMVar box ())
    uninterruptibleMask_ (takeMVar box))
  sideBySide "20,000 side by side" (\gate -> mask_ (parallel (milliseconds 3600000 `finally` uninterruptibleMask_ (readMVar gate)) (pure ())))
  waiting "1,500 one inside the other" $ \gate -> do
    let nest :: Int -> IO ()
        nest 0 = milliseconds 3600000 `finally` uninterruptibleMask_ (readMVar gate)
        nest n = both (nest (n - 1)) (milliseconds 3600000)
    done <- newEmptyMVar
    t <- forkIO (mask_ (nest 1500 `catch` \e -> const (pure ()) (e :: SomeException)) `finally` putMVar done ())
    milliseconds 1500
    void (forkIO (killThread t))
    milliseconds 1000
    pure (takeMVar done)
  -- And many after one another.
  forM_ [1 .. 3000 :: Int] $ \_ -> mask_ (parallel (milliseconds 3600000 `finally` uninterruptibleMask_ (threadDelay 100)) (pure ()))
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
    (cpu', wall') <- (,) <$> getCPUTime <*> getMonotonicTime
    let share = fromIntegral (cpu' - cpu) / 1e12 / (wall' - wall) :: Double
    putStrLn (what ++ ": " ++ show share ++ " of a processor while all wait")
    putMVar gate ()
    _ <- inThread 20000 what finish
    n <- living
    promise (what ++ ": " ++ show n ++ " threads were left") (n == 0)
    promise (what ++ ": they used " ++ show share ++ " of a processor while they waited") (share < 0.1)
