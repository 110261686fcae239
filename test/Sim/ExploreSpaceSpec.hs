-- |
-- How much memory an exploration takes.
module Sim.ExploreSpaceSpec (spec) where

import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
import Control.Monad (replicateM_, void, when)
import Data.IORef
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Parallel (allOf)
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Time (atomically, checkpoint)
import Memory (growingByLessThan)
import Support (guarded)

spec :: Spec
spec = guarded . describe "In constant memory run" $ do
  it "five thousand random schedules" $
    growingByLessThan 50000 5000 $ \step ->
      void (explore (randomly 5000) (\run -> run recharging >> step))

  it "five thousand schedules of an exhaustive exploration" $
    growingByLessThan 50000 5000 $ \step ->
      void (explore (exhaustively 4) {search = Exhaustive 4 5000} (\run -> run recharging >> step))

  it "many schedules of many threads, of which the queue keeps only numbers" $
    -- The first step is before the exploration: it is the queue itself that is small.
    growingByLessThan 500000 10 $ \step -> do
      step
      tried <- newIORef (0 :: Int)
      void . explore (exhaustively 2) {search = Exhaustive 2 200} $ \run -> do
        n <- atomicModifyIORef' tried (\n -> (n + 1, n + 1))
        when (n == 200) (replicateM_ 9 step)
        void . run $ allOf (replicate 60 (checkpoint >> sleep 1))

-- | A battery gets low once, and for longer than a moment.
recharging :: Behavior ()
recharging = do
  battery <- newTVarIO (20 :: Int)
  let low = Signal.debounce 0.5 ((< 10) <$> Signal.watching (readTVar battery))
      use n = atomically (readTVar battery >>= \b -> writeTVar battery (b - n))
      recharge = sleep 1 >> atomically (writeTVar battery 100)
  Signal.monitor low recharge (sleep 1 >> use 15 >> sleep 1)
