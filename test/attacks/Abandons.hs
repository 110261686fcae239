-- |
-- A behaviour that cannot be interrupted is abandoned, at whatever moment its operator is cancelled.
module Abandons (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (replicateM_)
import Data.Foldable (for_)
import GHC.Conc (setUncaughtExceptionHandler)

import Attack
import Behavior.Time (abandoning)

attack :: IO ()
attack = do
  setUncaughtExceptionHandler (const (pure ()))
  for_ [1 .. 4000 :: Int] $ \k -> do
    mayEnd <- newEmptyMVar
    ready <- newEmptyMVar
    over <- newEmptyMVar
    caller <- mask_ $ forkIOWithUnmask $ \unmask -> do
      putMVar ready ()
      _ <- try (unmask (abandoning 0 (uninterruptibleMask_ (readMVar mayEnd)))) :: IO (Either SomeException ())
      putMVar over ()
    takeMVar ready
    replicateM_ (k `mod` 50) yield
    throwTo caller (Boom k)
    _ <- inThread 5000 "abandoning" (takeMVar over)
    putMVar mayEnd ()
