-- |
-- What the operators cost: a line for nanoseconds, and one for allocated bytes. It is built twice,
-- with the dispatch to simulations and without; its argument (with, without) is part of the names.
module Main (main) where

import Control.Concurrent (runInUnboundThread)
import Control.Concurrent.STM (newTVarIO, readTVar)
import Control.Monad (forM_, replicateM_, void)
import GHC.Stats (allocated_bytes, getRTSStats)
import System.Environment (getArgs)
import System.Mem (performMinorGC)

import Behavior
import Behavior.Parallel (allOf)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Time (now)

main :: IO ()
main = runInUnboundThread $ do
  dispatch <- unwords <$> getArgs
  level <- newTVarIO (50 :: Int)
  let low = (< 10) <$> Signal.watching (readTVar level)
      measured =
        [ ("? that succeeds", 1000000, pure () ? pure ())
        , ("? that fails", 200000, failed ? pure ())
        , ("atomically", 1000000, void (atomically (readTVar level)))
        , ("parallel", 40000, parallel (pure ()) (pure ()))
        , ("both", 40000, both (pure ()) (pure ()))
        , ("allOf 10", 10000, void (allOf (replicate 10 (pure ()))))
        , ("monitor, watched", 40000, Signal.monitor low (pure ()) (pure ()))
        , ("monitor, polled", 10000, monitor (pure False) (pure ()) (pure ()))
        ] :: [(String, Int, Behavior ())]
  forM_ measured $ \(name, times, act) -> do
    replicateM_ (times `div` 10) act
    before <- allocated
    begun <- now
    replicateM_ times act
    ended <- now
    after <- allocated
    let nanoseconds = realToFrac (ended - begun) * 1e9 / fromIntegral times :: Double
        bytes = (after - before) `div` fromIntegral times
        report unit figure = putStrLn ("seam " ++ dispatch ++ " " ++ unit ++ ": " ++ name ++ "\t" ++ figure)
    report "ns" (show nanoseconds)
    report "bytes" (show bytes)
 where
  -- What a thread has allocated is counted when it has run, or by a garbage collection.
  allocated = performMinorGC >> allocated_bytes <$> getRTSStats
