-- |
-- How the benchmarks measure and print.
module Measured
  ( -- * Printing
    line

    -- * Measuring
  , time
  , processorTime
  , residentBytes
  , peakResidentBytes
  , quantile

    -- * Waiting for many threads
  , Latch
  , newLatch
  , resetLatch
  , countDown
  , awaitLatch
  ) where

import Control.Concurrent.MVar (MVar, newEmptyMVar, putMVar, takeMVar)
import Control.Exception (evaluate)
import Control.Monad (when)
import Data.IORef (IORef, atomicModifyIORef', newIORef, writeIORef)
import GHC.Clock (getMonotonicTimeNSec)
import Numeric (showFFloat)
import System.CPUTime (getCPUTime)
import System.IO (hFlush, stdout)

-- | Prints a figure on a line: its name, a tab, and the figure as a plain decimal.
line :: String -> Double -> IO ()
line name value = putStrLn (name ++ "\t" ++ showFFloat (Just 7) value "") >> hFlush stdout

-- | The monotonic time, in nanoseconds.
time :: IO Double
time = fromIntegral <$> getMonotonicTimeNSec

-- | The processor time that the process has used, in nanoseconds.
processorTime :: IO Double
processorTime = (/ 1e3) . fromIntegral <$> getCPUTime

-- | The resident memory of the process.
residentBytes :: IO Double
residentBytes = do
  sizes <- words <$> readFile "/proc/self/statm"
  evaluate (4096 * read (sizes !! 1))

-- | The highest resident memory of the process so far.
peakResidentBytes :: IO Double
peakResidentBytes = do
  status <- map words . lines <$> readFile "/proc/self/status"
  evaluate (sum [1024 * read kilobytes | "VmHWM:" : kilobytes : _ <- status])

-- | The value that the given part of the sorted samples does not exceed.
quantile :: Double -> [Double] -> Double
quantile part sorted = sorted !! (ceiling (part * fromIntegral (length sorted)) - 1)

-- | Opens when it has been counted down to zero. To count down does not block.
data Latch = Latch (IORef Int) (MVar ())

-- | A latch for the given number of threads.
newLatch :: Int -> IO Latch
newLatch n = Latch <$> newIORef n <*> newEmptyMVar

-- | Sets an opened latch to a number again.
resetLatch :: Latch -> Int -> IO ()
resetLatch (Latch missing _) = writeIORef missing

countDown :: Latch -> IO ()
countDown (Latch missing opened) = do
  left <- atomicModifyIORef' missing (\n -> (n - 1, n - 1))
  when (left == 0) (putMVar opened ())

-- | Waits until the latch opens.
awaitLatch :: Latch -> IO ()
awaitLatch (Latch _ opened) = takeMVar opened
