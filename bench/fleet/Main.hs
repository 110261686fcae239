{-# LANGUAGE LambdaCase #-}

-- |
-- What a fleet costs: many agents in one process. A line for each figure.
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
import qualified Behavior.Signal as Signal
import Behavior.Time (atomically)
import Measured

main :: IO ()
main =
  runInUnboundThread $
    getArgs >>= \case
      ["idle", n] -> idle "fleet" apart (read n)
      ["together", n] -> idle "fleet together" together (read n)
      ["bare", n] -> bare (read n)
      ["polled", n] -> asked "fleet polled" (\low -> Signal.monitor low (pure ())) (read n)
      ["woken", n] -> woken (read n)
      ["waiting", n] -> asked "fleet waited" (\low _ -> Signal.waitUntil low) (read n)
      _ -> die "usage: fleet (idle | together | bare | polled | waiting | woken) AGENTS"
 where
  -- Agents that come and go each by itself; and those of one behaviour.
  apart missions measure = for_ missions forkIO >> measure
  together missions measure = void (allOf missions) ||| measure

-- | Agents for which nothing happens; and then something, for all at once.
idle :: String -> ([Behavior ()] -> IO () -> IO ()) -> Int -> IO ()
idle name alongside n = do
  agents <- replicateM n newAgent
  waiting <- musterOf n
  let missions = [mission agent (arrive waiting) | agent <- agents]
  before <- residentBytes
  begun <- time
  alongside missions $ do
    atRest name n before begun waiting
    again waiting n
    changed <- time
    for_ agents $ \agent -> atomically (writeTVar (battery agent) 5)
    complete waiting
    recovered <- time
    line (name ++ " wake " ++ show n) ((recovered - changed) / fromIntegral n)

-- | The least that as many threads as the agents have can cost: each waits for a variable.
bare :: Int -> IO ()
bare n = do
  variables <- replicateM n (newTVarIO False)
  waiting <- musterOf (2 * n)
  before <- residentBytes
  begun <- time
  for_ variables $ \variable ->
    replicateM_ 2 . forkIO $ arrive waiting >> STM.atomically (readTVar variable >>= check)
  atRest "bare fleet" n before begun waiting
  -- Until here the variables must live, or the threads would be taken for deadlocked.
  for_ variables $ \variable -> STM.atomically (writeTVar variable True)

-- | Awaits all, and tells what each has cost since the size and time given, and what all
-- cost when nothing happens.
atRest :: String -> Int -> Double -> Double -> Muster -> IO ()
atRest name n before begun waiting = do
  complete waiting
  created <- time
  used <- processorTime
  sleep 2
  rested <- time
  usedSince <- subtract used <$> processorTime
  after <- residentBytes
  line (name ++ " creation " ++ show n) ((created - begun) / fromIntegral n)
  line (name ++ " bytes " ++ show n) ((after - before) / fromIntegral n)
  line (name ++ " idle cpu " ++ show n) (usedSince / (rested - created))

-- | Agents that each ask a sensor ten times a second.
asked :: String -> (Signal.Signal Bool -> Behavior () -> Behavior ()) -> Int -> IO ()
asked name operator n = readings name n $ \sensors measure ->
  void (allOf [operator ((< 10) <$> Signal.polling 0.1 sensor) (STM.atomically retry) | sensor <- sensors]) ||| measure

-- | The least that a thread for each sensor can cost: somebody else looks at the clock, and
-- fills a variable for each, ten times a second.
woken :: Int -> IO ()
woken n = readings "bare fleet" n $ \sensors measure -> do
  -- (Like ours, each compares what it has read.)
  ticks <- for sensors $ \sensor -> do
    tick <- newEmptyMVar
    _ <- forkIO . forever $ do
      takeMVar tick
      low <- (< 10) <$> sensor
      when low (throwIO (userError "the battery is low"))
    pure tick
  _ <- forkIO . forever $ for_ ticks (`tryPutMVar` ()) >> threadDelay 100000
  measure

-- | Tells what a reading costs, and how many of those that are due are made, of so many
-- sensors.
readings :: String -> Int -> ([IO Int] -> IO () -> IO ()) -> IO ()
readings name n alongside = do
  level <- newIORef (50 :: Int)
  -- Each counts in a place of its own, which only its own sensor's thread writes.
  counts <- callocArray n
  let readSensor count = (peek count >>= poke count . (+ 1)) >> readIORef level
      made = sum <$> peekArray n counts :: IO Int
  alongside (map (readSensor . advancePtr counts) [0 .. n - 1]) $ do
    -- Until the start is over, what it left is out of the way, and what lives is taken for
    -- old: that is so after two collections.
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
