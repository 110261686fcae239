-- |
-- How the benchmarks measure, and tell.
module Measured
  ( -- * Telling
    line

    -- * Measuring
  , time
  , processorTime
  , residentBytes
  , peakResidentBytes
  , quantile

    -- * Waiting for many
  , Muster
  , musterOf
  , again
  , arrive
  , complete
  ) where

import Control.Concurrent.MVar (MVar, newEmptyMVar, putMVar, takeMVar)
import Control.Exception (evaluate)
import Control.Monad (when)
import Data.IORef (IORef, atomicModifyIORef', newIORef, writeIORef)
import GHC.Clock (getMonotonicTimeNSec)
import Numeric (showFFloat)
import System.CPUTime (getCPUTime)
import System.IO (hFlush, stdout)

-- | A line for each figure: its name, a tabulator, and the figure as a plain decimal.
line :: String -> Double -> IO ()
line name value = putStrLn (name ++ "\t" ++ showFFloat (Just 7) value "") >> hFlush stdout

-- | What the clock shows, in nanoseconds.
time :: IO Double
time = fromIntegral <$> getMonotonicTimeNSec

-- | What the process has used of the processors, in nanoseconds.
processorTime :: IO Double
processorTime = (/ 1e3) . fromIntegral <$> getCPUTime

-- | What the process has in memory.
residentBytes :: IO Double
residentBytes = do
  sizes <- words <$> readFile "/proc/self/statm"
  evaluate (4096 * read (sizes !! 1))

-- | The most that the process has had in memory.
peakResidentBytes :: IO Double
peakResidentBytes = do
  status <- map words . lines <$> readFile "/proc/self/status"
  evaluate (sum [1024 * read kilobytes | "VmHWM:" : kilobytes : _ <- status])

-- | The value that this part of the sorted samples does not exceed.
quantile :: Double -> [Double] -> Double
quantile part sorted = sorted !! (ceiling (part * fromIntegral (length sorted)) - 1)

-- | Where many threads are awaited. Each comes by without waiting.
data Muster = Muster (IORef Int) (MVar ())

-- | Awaits so many threads.
musterOf :: Int -> IO Muster
musterOf n = Muster <$> newIORef n <*> newEmptyMVar

-- | Awaits so many once more, when it is complete.
again :: Muster -> Int -> IO ()
again (Muster missing _) = writeIORef missing

arrive :: Muster -> IO ()
arrive (Muster missing whole) = do
  left <- atomicModifyIORef' missing (\n -> (n - 1, n - 1))
  when (left == 0) (putMVar whole ())

complete :: Muster -> IO ()
complete (Muster _ whole) = takeMVar whole
