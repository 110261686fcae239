-- |
-- Whether something runs in constant memory, measured by the bytes that are live
-- after a major garbage collection (a thread's stack is among them) at two points of
-- the same run. And how much an action allocates, which is a measure of its work that does not
-- depend on the machine's load.
--
-- The runtime must keep statistics: run it with @+RTS -T@.
module Memory
  ( inConstantMemory
  , growingByLessThan
  , liveBytes
  , allocatedBy
  ) where

import Control.Concurrent (yield)
import Control.Monad (replicateM, when)
import Data.IORef
import Data.Int (Int64)
import GHC.Stats
import System.Mem (performMajorGC)
import Test.Hspec

-- | Passes to the action a callback that it runs at each of the given number of steps.
-- At the last step less than a megabyte more must be live than after a tenth of the
-- steps.
inConstantMemory :: Int -> (IO () -> IO ()) -> Expectation
inConstantMemory = growingByLessThan 1000000

-- | Like 'inConstantMemory', with the given number of bytes as the limit.
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
    _ -> expectationFailure "there were fewer steps than expected"

-- | The number of bytes that are live after a major garbage collection: the least of three, for a thread whose stack is
-- deep for a moment has 32 kB more.
liveBytes :: IO Int64
liveBytes =
  minimum <$> replicateM 3 (yield >> performMajorGC >> fromIntegral . gcdetails_live_bytes . gc <$> getRTSStats)

-- | The number of bytes that all threads have allocated while the action ran.
allocatedBy :: IO a -> IO Int64
allocatedBy act = do
  bytesBefore <- allocated
  _ <- act
  subtract bytesBefore <$> allocated
 where
  -- (Only a collection makes the number exact.)
  allocated = performMajorGC >> fromIntegral . allocated_bytes <$> getRTSStats
