{-# LANGUAGE ScopedTypeVariables #-}

-- | Children are stopped, awaited and forked by any thread, also while their scope ends.
-- Expected: no thread waits for ever, none is left, many children take constant memory.
module NurseryRaces (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM, forM_, replicateM_, void)
import GHC.Stats

import Attack
import Behavior
import Behavior.Parallel
import Behavior.STM (atomically)
import System.IO (hFlush, stdout)
import System.Mem (performMajorGC)

attack :: IO ()
attack = do
  forM_ [1 .. 2000 :: Int] $ \k -> do
    let throwing t = void (forkIO (threadDelay (k `mod` 300) >> throwTo t (Boom k)))
    end <- endsWithin 10000 ("race " ++ show k) throwing $
      scoped $ \nursery -> do
        children <- forM [1 .. 5 :: Int] $ \i ->
          fork nursery (threadDelay (i * 20) `finally` (fork nursery (pure ()) ? failed))
        -- The cleanup of each requests the stop of two children, and awaits the first.
        forM_ (zip children (drop 1 children)) $ \(a, b) ->
          fork nursery $
            milliseconds 3600000 `finally` do
              requestStop a >> requestStop b
              atomically (void (await a)) ? pure ()
        forM_ children requestStop
        forM_ children (\c -> (void (atomically (await c)) ? pure ()) `finally` requestStop c)
    end `seq` pure ()
    n <- liveThreadCount
    promise ("race " ++ show k ++ ": " ++ show n ++ " threads were left") (n == 0)
  putStrLn "races held" >> hFlush stdout
  -- A child that is stopped does not make its scope fail; one that nevertheless completes has
  -- a result.
  replicateM_ 2000 $ do
    r <- inThread 5000 "a stop" $ scoped $ \nursery -> do
      c <- fork nursery (('y' <$ milliseconds 3600000) `catch` \(_ :: SomeAsyncException) -> pure 'x')
      yield
      requestStop c
      atomically (await c) ? pure 'n'
    case r of
      Right c -> promise ("result " ++ [c]) (c `elem` "xn")
      Left e -> broken (show e)
  putStrLn "stops held" >> hFlush stdout
  enabled <- getRTSStatsEnabled
  _ <- inThread 40000 "many children" $ scoped $ \nursery -> do
    let some n = replicateM_ n $ do
          c <- fork nursery (milliseconds 3600000)
          requestStop c >> requestStop c
          atomically (await c) ? pure ()
    some (5000 :: Int)
    before <- resident enabled
    forM_ [1 .. 10 :: Int] $ \_ -> some 5000
    after <- resident enabled
    promise ("memory " ++ show (before, after)) (after < before + 2000000)
  pure ()
 where
  resident False = pure 0
  resident True = performMajorGC >> gcdetails_live_bytes . gc <$> getRTSStats
