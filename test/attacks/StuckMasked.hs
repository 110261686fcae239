-- | A limit around a masked operator expires while a cleanup stops a slow thread by throwTo.
-- Expected: the result or Nothing, as in GHC; no Timeout is received after the limit has ended.
module StuckMasked (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM, forM_, void, (>=>))
import System.Timeout (timeout)

import Attack
import Behavior

attack :: IO ()
attack = forM_ [1 .. 60 :: Int] $ \k -> do
  ends <- forM [1 .. 40 :: Int] $ \i -> do
    box <- newEmptyMVar
    _ <- mask_ $ forkIOWithUnmask $ \unmask -> try (unmask (one (20000 + 1000 * i))) >>= putMVar box
    pure box
  forM_ ends $
    takeMVar >=> either (\e -> void (broken ("round " ++ show k ++ ", escaped: " ++ show (e :: SomeException)))) pure
 where
  one limit = do
    _ <- timeout limit (mask_ (parallel (milliseconds 3600000 `finally` uninterruptibleMask_ slow) (pure ())))
    milliseconds 20
  slow = do
    masked <- newEmptyMVar
    other <- mask_ . forkIO $ uninterruptibleMask_ (putMVar masked () >> milliseconds 70)
    takeMVar masked
    killThread other
