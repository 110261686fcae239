{-# LANGUAGE ScopedTypeVariables #-}

-- | The simulator: 100,000 runs with pending exceptions, and runs that are interrupted at
-- random moments. Expected: the same seed gives the same run; nothing hangs, and no thread
-- and no memory is left.
module SimEnds (attack) where

import Control.Exception
import Control.Monad (forM_, void, when)
import GHC.Stats
import System.Mem (performMajorGC)
import System.Timeout (timeout)

import Attack
import Behavior
import Behavior.Parallel (allOf, firstOf, fork, requestStop, scoped)
import qualified Behavior.Signal as Signal
import Behavior.Sim

attack :: IO ()
attack = do
  enabled <- getRTSStatsEnabled
  forM_ [1 .. 1000] same
  before <- resident enabled
  forM_ [1 .. 20000] same
  after <- resident enabled
  n <- liveThreadCount
  promise (show n ++ " threads were left") (n == 0)
  promise ("memory " ++ show (before, after)) (after < before + 1000000)
  putStrLn ("the same seed, the same run; memory " ++ show (before, after))
  forM_ [1 .. 1500 :: Int] $ \k -> do
    _ <- inThread 10000 "an interrupted simulation" $
      timeout (k `mod` 400)
        (void (simulateWith defaultSimOptions {scheduled = Seeded k} (void program >> void program)))
    left <- liveThreadCount
    promise (show left ++ " threads were left") (left == 0)
 where
  same seed = do
    a <- simulateWith defaultSimOptions {scheduled = Seeded seed, detailedSteps = True} program
    b <- simulateWith defaultSimOptions {scheduled = Seeded seed, detailedSteps = True} program
    promise
      ("seed " ++ show seed ++ " gives two runs")
      (steps a == steps b && explain (outcome a) == explain (outcome b) && finished a == finished b)
    when (seed `mod` 10 == 0) $ do
      c <- simulateWith defaultSimOptions {scheduled = runSchedule a, detailedSteps = True} program
      promise
        ("seed " ++ show seed ++ ": its schedule does not replay it")
        (steps a == steps c && explain (outcome a) == explain (outcome c))
  resident False = pure 0
  resident True = performMajorGC >> gcdetails_live_bytes . gc <$> getRTSStats

program :: IO String
program = do
  _ <- try (firstOf [masked 0.2, masked 0.1, sleep 0.1]) :: IO (Either SomeException ())
  _ <- try (scoped (\n -> do
    c <- fork n (masked 1)
    d <- fork n (masked 0.3 `finally` requestStop c)
    requestStop d >> requestStop c >> sleep 0.1)) :: IO (Either SomeException ())
  let masks = both (masked 0.3) (sleep 0.2 >> failed)
      faults = allOf [masked 0.1 >> throwIO (Boom 1), sleep 1 `finally` throwIO (Boom 2)]
  r <- try (parallel masks (Signal.waitUntil (Signal.polling 0.05 (pure False)))) :: IO (Either SomeException ())
  _ <- try (void faults) :: IO (Either SomeException ())
  pure (show r)
 where
  masked d = do
    mask_ (sleepZero >> sleepZero) `finally` sleepZero
    uninterruptibleMask_ (sleep d)
    mask_ (sleep d `catch` \(_ :: Boom) -> sleepZero)
  sleepZero = sleep 0
