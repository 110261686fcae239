-- |
-- Work that grows with the number of branches, traces or filters, and not with its square.
module Behavior.ScaleSpec (spec) where

import Control.Concurrent.MVar (newEmptyMVar, putMVar, readMVar)
import Control.Monad (replicateM, replicateM_)
import Data.Foldable (for_)
import Test.Hspec

import Behavior
import Behavior.Parallel (allOf, await, fork, scoped)
import Behavior.STM (atomically, check, modifyTVar', newTVarIO, readTVar, writeTVar)
import qualified Behavior.Signal as Signal
import Behavior.Trace (withTrace)
import Memory (allocatedBy)
import Support

-- | (On one capability: with several, how often threads wake each other in vain depends on how the
-- capabilities are loaded.)
spec :: Spec
spec = around_ (within 60 . leavingNothing . onOneCapability) $ do
  describe "A scoped behaviour works in proportion to" children
  it "Traces at the same time cost in proportion to their number" $
    -- (GHC 9.6 does not count the last 16 MB: with fewer traces they would matter.)
    (4000, 8000) `takesAtMost` 2.5 $ \n -> allocatedBy $ do
      end <- newGate
      begun <- newTVarIO 0
      let traced = withTrace [] (atomically (modifyTVar' begun (+ 1)) >> pass end)
      allOf (replicate n traced) `both` (atomically (readTVar begun >>= check . (== n)) >> open end)
  describe "Eight filters in each other work for a change at most eight times as much as one:" filters

children :: Spec
children = do
  it "the number of its children that end while as many newer ones run" $
    (2000, 4000) `takesAtMost` 2.5 $ \n ->
      allocatedBy . scoped $ \nursery -> do
        gate <- newGate
        old <- replicateM n (fork nursery (pass gate))
        replicateM_ n (fork nursery (sleep 3600))
        open gate
        for_ old (atomically . await)
        -- The nursery forgets the old ones when there are more.
        replicateM_ n (fork nursery (pure ()) >>= atomically . await)

  it "the number of its children that fork at the same time" $
    (12000, 24000) `takesAtMost` 3 $ \n ->
      allocatedBy . scoped $ \nursery -> do
        -- (No TVar: without -threaded, each thread that goes on would wake all the others.)
        begin <- newEmptyMVar
        forking <- replicateM n . fork nursery $ do
          readMVar begin
          fork nursery (pure ()) >>= atomically . await
        putMVar begin ()
        for_ forking (atomically . await)

-- (More of them work more than in proportion: docs/signals.md.)
filters :: Spec
filters =
  for_ everyFilter $ \(name, filtering) ->
    it name $
      (1, 8) `takesAtMost` 8 $ \depth -> allocatedBy $ do
        level <- newTVarIO (0 :: Int)
        seen <- newTVarIO (0 :: Int)
        let change k = do
              atomically (writeTVar level (k `mod` 2))
              atomically (readTVar seen >>= check . (> k))
        Signal.switch (iterate filtering (Signal.watching (readTVar level)) !! depth)
          (\_ -> atomically (modifyTVar' seen (+ 1)) >> hang)
          ||| for_ [0 .. 200] change
 where
  everyFilter =
    [ ("debounce", Signal.debounce 0)
    , ("throttle", Signal.throttle 0)
    , ("hysteresis", fmap fromEnum . Signal.hysteresis False 0 1)
    , ("changes", Signal.changes)
    ]

-- | For the second size the work is at most the given number of times that for the first. (The least of three
-- counts: how often threads wake each other in vain differs.)
takesAtMost :: Integral work => (Int, Int) -> Double -> (Int -> IO work) -> Expectation
takesAtMost (few, many) times work = do
  (less, more) <- unzip <$> replicateM 3 ((,) <$> work few <*> work many)
  fromIntegral (minimum more) / fromIntegral (minimum less) `shouldSatisfy` (< times)
