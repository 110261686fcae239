{-# LANGUAGE ScopedTypeVariables #-}

-- | Thousands of children in one scope: they end, fork, are stopped, and one fails, all at once.
-- Expected: a stop request and a failure have their effect meanwhile, and nothing is left.
module ScopedScale (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM_, forever, replicateM, replicateM_, unless, void, when)
import GHC.Clock (getMonotonicTime)
import System.IO (hFlush, stdout)

import Attack
import Behavior
import Behavior.Parallel
import Behavior.STM

attack :: IO ()
attack = do
  forM_ [0, 3, 17, 60] $ \delay -> failing delay 8000
  said "failures held"
  stopping 8000
  said "stop requests held"
  forM_ [1 .. 12 :: Int] $ \k -> interrupted (k * k * 400) "a tree of children" (tree 11)
  said "trees held"
  forM_ [1 .. 12 :: Int] $ \k -> interrupted (k * k * 400) "a tree of nurseries" (nested 9)
  said "nurseries held"
  mutual 4000
  said "mutual stops held"
 where
  said what = putStrLn what >> hFlush stdout

-- | The older children end, as many newer ones wait, and the given action runs beside them, while the
-- scoped behaviour forks others.
crowd :: Int -> (Nursery -> Behavior ()) -> Behavior ()
crowd n beside = scoped $ \nursery -> do
  begin <- newTVarIO False
  replicateM_ n (fork nursery (atomically (readTVar begin >>= check)))
  replicateM_ n (fork nursery hang)
  beside nursery
  atomically (writeTVar begin True)
  forever (fork nursery (pure ()))

-- | One child fails while the others end.
failing :: Int -> Int -> IO ()
failing delay n = do
  failedAt <- newEmptyMVar
  end <- inThread 20000 "a failure among thousands" . crowd n $ \nursery ->
    void . fork nursery $
      milliseconds delay >> getMonotonicTime >>= putMVar failedAt >> (failWith "one of thousands" :: IO ())
  case end of
    Left e | Just (FailedBecause why) <- fromException e -> promise "another failure" (why == "one of thousands")
    _ -> broken ("not the failure: " ++ either show show end)
  took <- subtract <$> takeMVar failedAt <*> getMonotonicTime
  promise ("a failure took effect after " ++ show took ++ " s") (took < 5)
  nothingLeft "a failure"

-- | Children are stopped one after the other while others end.
stopping :: Int -> IO ()
stopping n = do
  slowest <- newMVar 0
  end <- inThread 30000 "stop requests among thousands" . crowd n $ \nursery ->
    void . fork nursery $ do
      replicateM_ 200 $ do
        child <- fork nursery hang
        t <- getMonotonicTime
        requestStop child
        _ <- atomically (tryAwait child >>= maybe retry pure)
        t' <- getMonotonicTime
        modifyMVar_ slowest (pure . max (t' - t))
      failWith "enough" :: IO ()
  promise "not all were stopped" (either (const True) (const False) end)
  took <- readMVar slowest
  promise ("a stop request took effect after " ++ show took ++ " s") (took < 5)
  nothingLeft "stop requests"

-- | Each child forks two, and waits for both.
tree :: Int -> Behavior ()
tree depth = scoped $ \nursery -> do
  let node :: Int -> Behavior ()
      node d = unless (d == 0) $ do
        two <- replicateM 2 (fork nursery (node (d - 1)))
        mapM_ (atomically . await) two
  node depth

-- | The same with a nursery for each.
nested :: Int -> Behavior ()
nested depth = unless (depth == 0) . scoped $ \nursery -> do
  two <- replicateM 2 (fork nursery (nested (depth - 1)))
  mapM_ (atomically . await) two

-- | The behaviour is interrupted after the given number of microseconds, if it has not ended.
interrupted :: Int -> String -> Behavior () -> IO ()
interrupted after what act = do
  end <- endsWithin 20000 what (\t -> void (forkIO (threadDelay after >> throwTo t (Boom after)))) act
  case end of
    Right () -> pure ()
    Left e -> promise (what ++ ": " ++ show e) (fromException e == Just (Boom after))
  nothingLeft what

-- | Each child requests the stop of the next, while the scope ends.
mutual :: Int -> IO ()
mutual n = do
  end <- inThread 20000 "mutual stops" . scoped $ \nursery -> do
    begin <- newTVarIO False
    handles <- newTVarIO []
    forM_ [1 .. n] $ \k -> do
      child <- fork nursery $ do
        atomically (readTVar begin >>= check)
        others <- atomically (readTVar handles)
        forM_ (take 1 (drop (k `mod` 50) others)) requestStop
        when (k `mod` 3 > 0) hang
      atomically (modifyTVar' handles (child :))
    atomically (writeTVar begin True)
    forM_ [1 .. 20 :: Int] $ \_ -> fork nursery (pure ()) >>= atomically . await
  either (broken . show) pure end
  nothingLeft "mutual stops"

hang :: Behavior a
hang = forever (milliseconds 3600000)

nothingLeft :: String -> IO ()
nothingLeft after = do
  n <- liveThreadCount
  promise (after ++ ": " ++ show n ++ " threads were left") (n == 0)
