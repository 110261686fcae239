{-# OPTIONS_GHC -fno-omit-yields #-}

-- |
-- A loop that never allocates, compiled so that it can still be interrupted.
module Sim.Busy (busy) where

-- | Counts for ever.
busy :: Int -> IO ()
busy n
  | n < 0 = pure ()
  | otherwise = busy (if n == maxBound then 0 else n + 1)
