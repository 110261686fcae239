-- | hysteresis, debounce and staleAfter under withShared, used by many operators at once and
-- one after the other. Expected: one memory, a dead sensor ends all of them, no thread is left.
module SharedFilters (attack) where

import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
import Control.Exception
import Control.Monad (replicateM_, void, when)
import Data.IORef
import GHC.Stats
import System.Mem (performMajorGC)

import Data.Maybe (isJust)

import Attack
import Behavior
import Behavior.Parallel (allOf, firstOf)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal

attack :: IO ()
attack = do
  -- The memory of a shared hysteresis outlives each operator, also while no operator reads it.
  replicateM_ 100 $ do
    level <- newTVarIO (50 :: Int)
    ended "hysteresis" $ Signal.withShared (Signal.hysteresis False 20 80 (Signal.watching (readTVar level))) $ \s -> do
      is "at first" s False
      set level 90
      Signal.waitUntil s
      set level 50
      is "kept" s True
      set level 10
      is "fallen" s False
      set level 50
      void (allOf [is "kept by all" s False, is "kept by all" s False])
      -- Now only the worker reads it.
      set level 85 >> sleep 0.05 >> set level 50
      is "read only by the worker" s True
  putStrLn "hysteresis held"
  -- A sensor that throws, hangs or recovers: each time it affects all operators.
  replicateM_ 50 $ do
    count <- newIORef (0 :: Int)
    let reading = do
          n <- atomicModifyIORef' count (\n -> (n + 1, n))
          if n >= 5 then throwIO (Boom n) else pure (n >= 0)
    faulted "a dead sensor" $ Signal.withShared (Signal.debounce 0 (Signal.polling 0.001 reading)) $ \s ->
      void $
        allOf
          [ Signal.whileHolding s (sleep 3600)
          , Signal.rSelect s (sleep 3600) (sleep 3600)
          , Signal.monitor (not <$> s) (pure ()) (sleep 3600)
          ]
    hung <- newIORef (0 :: Int)
    let hangs = do
          n <- atomicModifyIORef' hung (\n -> (n + 1, n))
          True <$ when (n == 3) (sleep 3600)
        stale = Signal.staleAfter 0.005 (Signal.polling 0.001 hangs)
    failing "a stale sensor" $ Signal.withShared (Signal.hysteresis False False True stale) $ \s ->
      void (firstOf [Signal.whileHolding s (sleep 3600), Signal.waitUntil (not <$> s)])
    failing "stale, in a debounce, shared" $ do
      writeIORef hung 0
      Signal.withShared (Signal.debounce 0.001 stale) $ \s -> Signal.whileHolding s (sleep 3600)
    failing "stale outside of the share" $ do
      writeIORef hung 0
      Signal.withShared (Signal.polling 0.001 hangs) $ \s ->
        Signal.whileHolding (Signal.staleAfter 0.005 (Signal.debounce 0.001 s)) (sleep 3600)
  putStrLn "dead and stale sensors held"
  -- A shared debounce settles, whichever operator reads it; and a flicker is suppressed.
  replicateM_ 30 $ do
    flag <- newTVarIO False
    ended "debounce" $ Signal.withShared (Signal.debounce 0.02 (Signal.watching (readTVar flag))) $ \s -> do
      is "debounce, at first" s False
      set flag True >> sleep 0.002 >> set flag False
      sleep 0.03
      is "a flicker" s False
      set flag True
      Signal.waitUntil s
      void (allOf [is "settled" s True, Signal.rSelect s (pure ()) (void (broken "not settled"))])
  putStrLn "debounce held"
  -- Memory, over many operators on one shared signal.
  enabled <- getRTSStatsEnabled
  level <- newTVarIO (50 :: Int)
  let signal = Signal.hysteresis True 20 80 (Signal.debounce 0 (Signal.watching (readTVar level)))
  ended "many operators" $ Signal.withShared signal $ \s -> do
    replicateM_ 10000 (Signal.waitUntil s)
    before <- resident enabled
    replicateM_ 100000 (Signal.waitUntil s)
    after <- resident enabled
    promise ("memory " ++ show (before, after)) (after < before + 1000000)
 where
  set v x = atomically (writeTVar v x)
  is what s expected =
    Signal.rSelect s (pure True) (pure False) >>= \got -> promise (what ++ ": " ++ show got) (got == expected)
  ended what act = inThread 30000 what act >>= either (\e -> void (broken (what ++ ": " ++ show e))) pure >> none what
  faulted what act = inThread 5000 what act >>= thrown what (\e -> isJust (fromException e :: Maybe Boom))
  failing what act = inThread 5000 what act >>= thrown what (\e -> isJust (fromException e :: Maybe BehaviorFailed))
  thrown what isIt end = do
    either (\e -> promise (what ++ ": " ++ show e) (isIt e)) (const (void (broken what))) end
    none what
  none what = liveThreadCount >>= \n -> promise (what ++ ": " ++ show n ++ " threads were left") (n == 0)
  resident False = pure 0
  resident True = performMajorGC >> gcdetails_live_bytes . gc <$> getRTSStats
