-- |
-- Whether something runs in constant memory, measured by the bytes that are live
-- after a major garbage collection (a thread's stack is among them) at two points of
-- the same run.
--
-- The runtime must keep statistics: run it with @+RTS -T@.
module Memory
  ( inConstantMemory
  , growingByLessThan
  , liveBytes
  ) where

import Control.Monad (when)
import Data.IORef
import Data.Int (Int64)
import GHC.Stats
import System.Mem (performMajorGC)
import Test.Hspec

-- | Gives the action what it is to call at each of so many steps, and compares
-- what is live at a tenth of them with what is live at the last: that is less than a
-- megabyte more.
inConstantMemory :: Int -> (IO () -> IO ()) -> Expectation
inConstantMemory = growingByLessThan 1000000

-- | The same, for so many bytes.
growingByLessThan :: Int64 -> Int -> (IO () -> IO ()) -> Expectation
growingByLessThan bytes steps act = do
  getRTSStatsEnabled `shouldReturn` True
  counter <- newIORef (0 :: Int)
  early <- newIORef Nothing
  late <- newIORef Nothing
  act $ do
    n <- atomicModifyIORef' counter (\n -> (n + 1, n + 1))
    when (n == steps `div` 10) $ liveBytes >>= writeIORef early . Just
    when (n == steps) $ liveBytes >>= writeIORef late . Just
  measured <- (,) <$> readIORef early <*> readIORef late
  case measured of
    (Just atFirst, Just atLast) -> atLast - atFirst `shouldSatisfy` (< bytes)
    _ -> expectationFailure "there were fewer steps than it should have made"

-- | What is live after a major garbage collection.
liveBytes :: IO Int64
liveBytes = do
  performMajorGC
  fromIntegral . gcdetails_live_bytes . gc <$> getRTSStats
