-- |
-- The memory that an exploration takes.
module Sim.ExploreSpaceSpec (spec) where

import Control.Concurrent (mkWeakThreadId, myThreadId)
import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
import Control.Exception (evaluate, uninterruptibleMask_)
import Control.Monad (void, when)
import Data.Foldable (for_)
import Data.IORef
import Data.Int (Int64)
import Data.Maybe (isJust)
import GHC.Stats (getRTSStatsEnabled)
import System.Mem (performMajorGC)
import System.Mem.Weak (deRefWeak)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Parallel (allOf)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Time (abandoning, checkpoint, timeout)
import Memory (liveBytes)
import Support (guarded)

spec :: Spec
spec = guarded . describe "In constant memory run" $ do
  it "five thousand random schedules" $ do
    (early, late) <- liveAfter 500 5000 (randomly 5000) recharging
    late - early `shouldSatisfy` (< 50000)

  it "five thousand schedules of an exhaustive exploration" $ do
    (early, late) <- liveAfter 500 5000 (exhaustively 4) {planSearch = Exhaustive 4 5000} recharging
    late - early `shouldSatisfy` (< 50000)

  it "many schedules of many threads, since the queue keeps only numbers" $ do
    -- The first measurement is before there is a queue, so it is the queue that is small.
    (early, late) <- liveAfter 1 200 (exhaustively 2) {planSearch = Exhaustive 2 200} $
      void (allOf (replicate 60 (checkpoint >> sleep 1)))
    late - early `shouldSatisfy` (< 500000)

  describe "a run that is kept, without the threads that" $ do
    it "ended" . keepsNone $ \here -> both (sleep 1) (sleep 2 >> here)
    it "were stopped" . keepsNone $ \here -> sleep 1 ||| (here >> sleep 2)
    it "were abandoned" . keepsNone $ \here ->
      timeout 1 (abandoning 1 (uninterruptibleMask_ (here >> sleep 7200))) ? pure ()

-- | The behaviour calls its argument in one thread. (The texts of events are made when they are needed, and keep what
-- they are made of until then.)
keepsNone :: (Behavior () -> Behavior a) -> Expectation
keepsNone behavior = do
  threads <- newIORef []
  ran <- simulate . behavior $
    myThreadId >>= mkWeakThreadId >>= \thread -> modifyIORef' threads (thread :)
  _ <- evaluate (length (show (events ran)))
  performMajorGC
  left <- readIORef threads >>= traverse deRefWeak
  map isJust left `shouldBe` [False]
  finished ran `shouldSatisfy` (>= 1)

-- | The live bytes at the beginning of these two schedules. They are measured within the
-- simulation, since the watchdog ends when there is none.
--
-- The watchdog may still hold a simulation that is over. So each number is the minimum of
-- ten schedules: this one and the nine before.
liveAfter :: Int -> Int -> Plan -> Behavior a -> IO (Int64, Int64)
liveAfter first second plan behavior = do
  getRTSStatsEnabled `shouldReturn` True
  tried <- newIORef (0 :: Int)
  early <- newIORef maxBound
  late <- newIORef maxBound
  void . explore plan $ \run -> do
    n <- atomicModifyIORef' tried (\n -> (n + 1, n + 1))
    void . run $ do
      for_ [(first, early), (second, late)] $ \(here, least) ->
        when (n > here - 10 && n <= here) $ liveBytes >>= modifyIORef' least . min
      behavior
  (,) <$> readIORef early <*> readIORef late

-- | A battery that gets low once, for longer than the debounce.
recharging :: Behavior ()
recharging = do
  battery <- newTVarIO (20 :: Int)
  let low = Signal.debounce 0.5 ((< 10) <$> Signal.watching (readTVar battery))
      use n = atomically (readTVar battery >>= \b -> writeTVar battery (b - n))
      recharge = sleep 1 >> atomically (writeTVar battery 100)
  Signal.monitor low recharge (sleep 1 >> use 15 >> sleep 1)
