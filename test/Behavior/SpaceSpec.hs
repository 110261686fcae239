-- |
-- What runs in constant memory, measured by the bytes that are live after a major
-- garbage collection (a thread's stack is among them) at two points of the same run.
--
-- The runtime must keep statistics: run it with @+RTS -T@.
module Behavior.SpaceSpec (spec) where

import Control.Exception (throwIO)
import Control.Monad (replicateM_, when)
import Data.IORef
import Data.Int (Int64)
import GHC.Stats
import System.Mem (performMajorGC)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Parallel (firstOf, fork, scoped)
import Behavior.Time (atomically, timeout)
import Support

spec :: Spec
spec = guarded . describe "In constant memory run" $ do
  it "a million failed alternatives, nested to the right by ?" $
    inConstantMemory 1000000 $ \step -> do
      n <- newIORef (0 :: Int)
      let alternatives = foldr (\_ others -> (step n >> failed) ? others) (pure ()) [1 .. 1000000 :: Int]
      alternatives

  it "a million failed inputs of fallbackOver" $
    inConstantMemory 1000000 $ \step -> do
      n <- newIORef 0
      fallbackOver [0 .. 1000000 :: Int] $ \input ->
        if input == 1000000 then pure () else step n >> failed

  it "a million failed attempts" $
    inConstantMemory 1000000 $ \step -> do
      n <- newIORef 0
      attempt 1000000 (step n >> failed) ? pure ()

  it "a million recursions through the second behaviour of ?" $
    inConstantMemory 1000000 $ \step -> do
      n <- newIORef 0
      let again = do
            tried <- readIORef n
            if tried == 1000000 then pure () else (step n >> throwIO (Failure "again")) ? again
      again

  it "fifty thousand operators with branches, one after the other" $
    inConstantMemory 50000 $ \step -> do
      n <- newIORef 0
      replicateM_ 10000 $ do
        step n >> parallel (pure ()) hang
        step n >> both (pure ()) (pure ())
        step n >> firstOf [pure (), hang, hang]
        step n >> timeout 3600 (pure ())
        step n >> scoped (\nursery -> fork nursery (pure ()) >>= atomically)

  it "twenty thousand forks in one scoped behaviour" $
    inConstantMemory 20000 $ \step -> do
      n <- newIORef 0
      scoped $ \nursery -> replicateM_ 20000 (step n >> fork nursery (pure ()) >>= atomically)

-- | Gives the action what it is to call at each of so many steps, and compares
-- what is live at a tenth of them with what is live at the last.
inConstantMemory :: Int -> ((IORef Int -> IO ()) -> IO ()) -> Expectation
inConstantMemory steps act = do
  enabled <- getRTSStatsEnabled
  enabled `shouldBe` True
  early <- newIORef Nothing
  late <- newIORef Nothing
  act $ \counter -> do
    n <- readIORef counter
    writeIORef counter $! n + 1
    when (n + 1 == steps `div` 10) $ liveBytes >>= writeIORef early . Just
    when (n + 1 == steps) $ liveBytes >>= writeIORef late . Just
  measured <- (,) <$> readIORef early <*> readIORef late
  case measured of
    (Just before', Just after') -> after' - before' `shouldSatisfy` (< 1000000)
    _ -> expectationFailure "there were fewer steps than it should have made"

liveBytes :: IO Int64
liveBytes = do
  performMajorGC
  fromIntegral . gcdetails_live_bytes . gc <$> getRTSStats
