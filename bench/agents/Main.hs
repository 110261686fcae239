{-# LANGUAGE LambdaCase #-}

-- |
-- What a fleet costs: many agents in one process. Prints a line for each figure.
module Main (main) where

import Control.Concurrent
import Control.Concurrent.STM (check, newTVarIO, readTVar, retry, writeTVar)
import qualified Control.Concurrent.STM as STM
import Control.Exception (throwIO)
import Control.Monad (forever, replicateM, replicateM_, void, when)
import Data.Foldable (for_)
import Data.IORef (newIORef, readIORef)
import Data.Traversable (for)
import Foreign (advancePtr, callocArray, peek, peekArray, poke)
import System.Environment (getArgs)
import System.Exit (die)
import System.Mem (performMajorGC)

import Agent
import Behavior
import Behavior.Parallel
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Measured

main :: IO ()
main =
  runInUnboundThread $
    getArgs >>= \case
      ["idle", n] -> idle "fleet" apart (read n)
      ["together", n] -> idle "fleet together" together (read n)
      ["bare", n] -> bare (read n)
      ["polled", n] -> polled "fleet polled" (\low -> Signal.monitor low (pure ())) (read n)
      ["woken", n] -> woken (read n)
      ["waiting", n] -> polled "fleet waited" (\low _ -> Signal.waitUntil low) (read n)
      _ -> die "usage: fleet (idle | together | bare | polled | waiting | woken) AGENTS"
 where
  -- Each agent in its own thread, or all in one behaviour.
  apart missions measure = for_ missions forkIO >> measure
  together missions measure = void (allOf missions) ||| measure

-- | Agents for which nothing changes; then the battery of all becomes low at once.
idle :: String -> ([Behavior ()] -> IO () -> IO ()) -> Int -> IO ()
idle name alongside n = do
  agents <- replicateM n newAgent
  latch <- newLatch n
  let missions = [mission agent (countDown latch) | agent <- agents]
  before <- residentBytes
  begun <- time
  alongside missions $ do
    atRest name n before begun latch
    resetLatch latch n
    changed <- time
    for_ agents $ \agent -> atomically (writeTVar (battery agent) 5)
    awaitLatch latch
    recovered <- time
    line (name ++ " wake " ++ show n) ((recovered - changed) / fromIntegral n)

-- | The lower bound: the same number of threads, each of which waits for a variable.
bare :: Int -> IO ()
bare n = do
  variables <- replicateM n (newTVarIO False)
  latch <- newLatch (2 * n)
  before <- residentBytes
  begun <- time
  for_ variables $ \variable ->
    replicateM_ 2 . forkIO $ countDown latch >> STM.atomically (readTVar variable >>= check)
  atRest "bare fleet" n before begun latch
  -- Keeps the variables alive until here: otherwise GHC would detect a deadlock.
  for_ variables $ \variable -> STM.atomically (writeTVar variable True)

-- | Waits for all agents. Prints what each has cost since the given size and time, and what all
-- cost while nothing changes.
atRest :: String -> Int -> Double -> Double -> Latch -> IO ()
atRest name n before begun latch = do
  awaitLatch latch
  created <- time
  used <- processorTime
  sleep 2
  rested <- time
  usedSince <- subtract used <$> processorTime
  after <- residentBytes
  line (name ++ " creation " ++ show n) ((created - begun) / fromIntegral n)
  line (name ++ " bytes " ++ show n) ((after - before) / fromIntegral n)
  line (name ++ " idle cpu " ++ show n) (usedSince / (rested - created))

-- | Agents that each poll a sensor ten times a second.
polled :: String -> (Signal.Signal Bool -> Behavior () -> Behavior ()) -> Int -> IO ()
polled name operator n = readings name n $ \sensors measure ->
  void (allOf [operator ((< 10) <$> Signal.polling 0.1 sensor) (STM.atomically retry) | sensor <- sensors]) ||| measure

-- | The lower bound for one thread per sensor: another thread wakes them all, by an 'MVar' each,
-- ten times a second.
woken :: Int -> IO ()
woken n = readings "bare fleet" n $ \sensors measure -> do
  -- (Like the operator, each compares what it has read.)
  ticks <- for sensors $ \sensor -> do
    tick <- newEmptyMVar
    _ <- forkIO . forever $ do
      takeMVar tick
      low <- (< 10) <$> sensor
      when low (throwIO (userError "the battery is low"))
    pure tick
  _ <- forkIO . forever $ for_ ticks (`tryPutMVar` ()) >> threadDelay 100000
  measure

-- | Prints what a reading costs with the given number of sensors, and the fraction of the due
-- readings that are made.
readings :: String -> Int -> ([IO Int] -> IO () -> IO ()) -> IO ()
readings name n alongside = do
  level <- newIORef (50 :: Int)
  -- Each sensor has its own counter, which only its thread writes.
  counts <- callocArray n
  let readSensor count = (peek count >>= poke count . (+ 1)) >> readIORef level
      made = sum <$> peekArray n counts :: IO Int
  alongside (map (readSensor . advancePtr counts) [0 .. n - 1]) $ do
    -- Waits until all have started. Two garbage collections then remove the garbage of the start,
    -- and promote what is live to the old generation.
    sleep 1
    replicateM_ 2 performMajorGC
    sleep 1
    (t0, cpu0, made0) <- (,,) <$> time <*> processorTime <*> made
    sleep 6
    (t1, cpu1, made1) <- (,,) <$> time <*> processorTime <*> made
    let readings' = fromIntegral (made1 - made0)
        due = fromIntegral n * (t1 - t0) / 1e8
    line (name ++ " reading " ++ show n) ((cpu1 - cpu0) / readings')
    line (name ++ " kept " ++ show n) (readings' / due)
