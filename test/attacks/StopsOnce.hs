{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- | The operator itself makes the stop request of a single branch, while three exceptions are
-- thrown to its caller, bound or not. Expected: each branch is stopped once, never twice.
module StopsOnce (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM_, unless, void)
import Data.IORef

import Attack
import Behavior
import Behavior.Parallel (allOf, firstOf, scoped)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Time (timeout)
import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)

attack :: IO ()
attack =
  forM_ [1 .. 500 :: Int] $ \k ->
    forM_ operators $ \(name, operator) -> do
      entered <- newEmptyMVar
      flag <- newTVarIO True
      stops <- newIORef (0 :: Int)
      over <- newEmptyMVar
      let what = name ++ ", round " ++ show k
          -- Uninterruptible for a moment, then stopped; its cleanup can be interrupted.
          slow = mask $ \restore -> do
            uninterruptibleMask_ (putMVar entered () >> threadDelay (k `mod` 7 * 20))
            end <- try (restore (milliseconds 3600000)) :: IO (Either SomeException ())
            count stops
            again <- try (threadDelay 150)
            either (\(e :: SomeException) -> count stops >> throwIO e) pure again
            either throwIO pure end
          caller = if k `mod` 3 == 0 && rtsSupportsBoundThreads then forkOS else forkIO
          masking = case k `mod` 4 of
            0 -> mask_
            _ -> id
          act = try (masking (operator (Signal.watching (readTVar flag)) slow)) :: IO (Either SomeException ())
      t <- caller (void act `finally` uninterruptibleMask_ (putMVar over ()))
      takeMVar entered
      forM_ [0 .. 2] $ \i -> forkIO (threadDelay ((k * 37 + i * 53) `mod` 200) >> throwTo t (Boom i))
      threadDelay (k * 29 `mod` 150) >> atomically (writeTVar flag False)
      waiting (5000 :: Int) what over
      n <- readIORef stops
      unless (n == 1) (void (broken (what ++ ": stopped " ++ show n ++ " times")))
      left <- liveThreadCount
      promise (what ++ ": " ++ show left ++ " threads were left") (left == 0)
 where
  count r = atomicModifyIORef' r (\n -> (n + 1, ()))
  waiting n what over =
    tryTakeMVar over >>= \case
      Just () -> pure ()
      Nothing
        | n == 0 -> void (broken (what ++ ": the stop request was lost"))
        | otherwise -> threadDelay 1000 >> waiting (n - 1) what over

operators :: [(String, Signal.Signal Bool -> IO () -> IO ())]
operators =
  [ ("whileHolding", \c act -> Signal.whileHolding c act ? pure ())
  , ("switch", \c act -> Signal.switch c (\k -> if k then act else pure ()))
  , ("monitor", \c act -> Signal.monitor (not <$> c) failed act ? pure ())
  , ("parallel", \c act -> parallel act (Signal.waitUntil (not <$> c)))
  , ("firstOf", \c act -> firstOf [Signal.waitUntil (not <$> c), act])
  , ("allOf", \c act -> void (allOf [Signal.waitUntil (not <$> c) >> failed, act]) ? pure ())
  , ("scoped", \c act -> scoped (\_ -> parallel act (Signal.waitUntil (not <$> c))))
  , ("nested", \c act -> Signal.whileHolding c (Signal.whileHolding (pure True) (void (timeout 3600 act))) ? pure ())
  ]
