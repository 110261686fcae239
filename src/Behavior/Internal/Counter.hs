{-# LANGUAGE MagicHash #-}
{-# LANGUAGE UnboxedTuples #-}

-- |
-- A number that many threads change at once, by one machine instruction.
module Behavior.Internal.Counter
  ( Counter
  , newCounter
  , add
  , total
  ) where

import GHC.Exts
import GHC.IO (IO (..))

-- | A number in a place of its own, which is zero at first.
data Counter = Counter (MutableByteArray# RealWorld)

-- | A new one.
newCounter :: IO Counter
newCounter = IO $ \s -> case newByteArray# 8# s of
  (# s1, array #) -> case writeIntArray# array 0# 0# s1 of
    s2 -> (# s2, Counter array #)

-- | Adds to it, in one step.
add :: Counter -> Int -> IO ()
add (Counter array) (I# n) = IO $ \s -> case fetchAddIntArray# array 0# n s of
  (# s1, _ #) -> (# s1, () #)

-- | The number that it has now.
total :: Counter -> IO Int
total (Counter array) = IO $ \s -> case atomicReadIntArray# array 0# s of
  (# s1, n #) -> (# s1, I# n #)
