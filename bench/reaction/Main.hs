{-# LANGUAGE LambdaCase #-}

-- |
-- How long it takes from the change of a condition to the first step of the recovery, and,
-- to compare, to the first step of a thread that waits for nothing but that change. A line
-- for each figure, in microseconds.
module Main (main) where

import Control.Concurrent
  ( MVar
  , forkIO
  , getNumCapabilities
  , newEmptyMVar
  , putMVar
  , runInUnboundThread
  , takeMVar
  )
import Control.Concurrent.STM (TVar, check, newTVarIO, readTVar, writeTVar)
import qualified Control.Concurrent.STM as STM
import Control.Monad (forever, replicateM, replicateM_, when)
import Data.Foldable (for_)
import Data.IORef (IORef, newIORef, readIORef, writeIORef)
import Data.List (sort)
import Foreign.C.Types (CInt (..), CUInt (..))
import System.Environment (getArgs)
import System.Exit (die)

import Agent
import Behavior
import qualified Behavior.Signal as Signal
import Measured

-- | What a reaction is made of.
data Stage = Stage
  { flag :: TVar Bool
  -- ^ The condition.
  , ready :: MVar ()
  -- ^ Filled whenever a change may come.
  , noted :: IORef Double
  -- ^ When the latest reaction took its first step.
  }

main :: IO ()
main =
  runInUnboundThread $
    getArgs >>= \case
      [who] | Just reacts <- lookup who reactors -> measured who "" reacts
      [who, n] | Just reacts <- lookup who reactors -> crowd (read n) >> measured who (" among " ++ n) reacts
      _ -> die "usage: reaction (ours | bare) [AGENTS]"
 where
  reactors = [("ours", ours), ("bare", bare)]

-- | Interrupts a sleeping task.
ours :: Stage -> IO ()
ours stage = Signal.monitor (Signal.watching (readTVar (flag stage))) (reaction stage) task
 where
  task = putMVar (ready stage) () >> sleep 3600

-- | The least that a reaction can be.
bare :: Stage -> IO ()
bare stage = forever $ do
  putMVar (ready stage) ()
  STM.atomically (readTVar (flag stage) >>= check)
  reaction stage

-- | Notes the time before anything else.
reaction :: Stage -> IO ()
reaction stage = do
  time >>= writeIORef (noted stage)
  STM.atomically (writeTVar (flag stage) False)

-- | Changes the condition again and again, whenever all has been quiet for a moment.
measured :: String -> String -> (Stage -> IO ()) -> IO ()
measured who among reacts = do
  stage <- Stage <$> newTVarIO False <*> newEmptyMVar <*> newIORef 0
  _ <- forkIO (reacts stage)
  takeMVar (ready stage)
  let sample = do
        _ <- usleep 300
        changed <- time
        STM.atomically (writeTVar (flag stage) True)
        takeMVar (ready stage)
        reacted <- readIORef (noted stage)
        pure ((reacted - changed) / 1000)
  replicateM_ 500 sample
  sorted <- sort <$> replicateM 8000 sample
  processors <- case among of
    "" -> (" N" ++) . show <$> getNumCapabilities
    _ -> pure among
  for_ [("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999)] $ \(name, part) ->
    line ("reaction" ++ processors ++ " " ++ name ++ " " ++ who) (quantile part sorted)

-- | Waits as the driver of a device does: outside of the runtime, all of whose threads are
-- idle meanwhile, and without its timers, which the sleeping task may use too.
foreign import ccall safe "usleep" usleep :: CUInt -> IO CInt

-- | Other agents, for which nothing happens.
crowd :: Int -> IO ()
crowd n = when (n > 0) $ do
  waiting <- musterOf n
  replicateM_ n (newAgent >>= \agent -> forkIO (mission agent (arrive waiting)))
  complete waiting
