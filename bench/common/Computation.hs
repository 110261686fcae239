-- |
-- Endless computations, which a reaction runs beside.
module Computation
  ( searching
  , counting
  ) where

import Control.Exception (evaluate)
import Data.Foldable (for_)

-- | A search that allocates all the time, and keeps little alive: all ways to place the queens.
searching :: IO ()
searching = for_ (cycle [6, 7, 8]) $ evaluate . length . queens

queens :: Int -> [[Int]]
queens n = go n
 where
  go 0 = [[]]
  go k = [q : others | others <- go (k - 1 :: Int), q <- [1 .. n], and (zipWith (apart q) others [1 ..])]
  apart q other distance = q /= other && abs (q - other) /= distance

-- | A calculation that allocates little: it can be interrupted every few microseconds.
counting :: IO ()
counting = for_ [1 ..] $ evaluate . steps 10000

-- | Steps of a random number generator, Knuth's for MMIX.
steps :: Int -> Int -> Int
steps n seed
  | n == 0 = seed
  | otherwise = steps (n - 1) (seed * 6364136223846793005 + 1442695040888963407)
{-# NOINLINE steps #-}
