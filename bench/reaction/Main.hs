{-# LANGUAGE LambdaCase #-}

-- |
-- How long it takes from the change of a condition to the first step of the recovery and, to
-- compare, to the first step of a thread that waits only for that change: while nothing else
-- runs, while other agents wait, or while another thread computes endlessly. Prints a line for
-- each figure, in microseconds.
module Main (main) where

import Control.Concurrent
  ( MVar
  , forkIO
  , forkOn
  , getNumCapabilities
  , killThread
  , myThreadId
  , newEmptyMVar
  , putMVar
  , runInUnboundThread
  , takeMVar
  , threadCapability
  )
import Control.Concurrent.STM (TVar, check, newTVarIO, readTVar, writeTVar)
import qualified Control.Concurrent.STM as STM
import Control.Exception (evaluate, finally)
import Control.Monad (forever, replicateM_, when)
import Data.Foldable (for_)
import Data.IORef (IORef, newIORef, readIORef, writeIORef)
import Data.List (sort)
import Foreign.C.Types (CInt (..), CUInt (..))
import System.Environment (getArgs)
import System.Exit (die)
import Text.Read (readMaybe)

import Agent
import Behavior
import qualified Behavior.Signal as Signal
import Measured

-- | What a reaction uses.
data Stage = Stage
  { flag :: TVar Bool
  -- ^ The condition.
  , ready :: MVar ()
  -- ^ Filled when the next change may be made.
  , reactedAt :: IORef Double
  -- ^ When the latest reaction took its first step.
  }

main :: IO ()
main =
  runInUnboundThread $
    getArgs >>= \case
      variant : others
        | Just reacts <- lookup variant reactors -> startLoad others >>= measured variant reacts
      _ -> usage
 where
  reactors = [("ours", ours), ("by hand", byHand), ("bare", bare)]

-- | Starts the load, and gives its part of the figures' names.
startLoad :: [String] -> IO String
startLoad = \case
  [] -> processors
  [kind] | Just computation <- lookup kind computations -> do
    -- On another capability than this thread and those that it starts, if there is one.
    -- (This thread is not always on the first.)
    (mine, _) <- threadCapability =<< myThreadId
    _ <- forkOn (mine + 1) computation
    ((kind ++ " ") ++) <$> processors
  [n] | Just agents <- readMaybe n -> ("among " ++ n) <$ crowd agents
  _ -> usage
 where
  processors = ("N" ++) . show <$> getNumCapabilities
  computations = [("busy", searching), ("counting", counting)]

usage :: IO a
usage = die "usage: reaction (ours | \"by hand\" | bare) [AGENTS | busy | counting]"

-- | Interrupts a sleeping task.
ours :: Stage -> IO ()
ours stage = Signal.monitor (Signal.watching (readTVar (flag stage))) (reaction stage) task
 where
  task = putMVar (ready stage) () >> sleep 3600

-- | Exactly the same steps by hand: a thread waits for the change, stops the task, waits for its
-- end, and starts another thread for the recovery.
byHand :: Stage -> IO ()
byHand stage = forever $ do
  ended <- newEmptyMVar
  recovered <- newEmptyMVar
  task <- forkIO ((putMVar (ready stage) () >> STM.atomically STM.retry) `finally` putMVar ended ())
  STM.atomically (readTVar (flag stage) >>= check)
  killThread task
  takeMVar ended
  _ <- forkIO (reaction stage >> putMVar recovered ())
  takeMVar recovered

-- | The lower bound.
bare :: Stage -> IO ()
bare stage = forever $ do
  putMVar (ready stage) ()
  STM.atomically (readTVar (flag stage) >>= check)
  reaction stage

-- | Stores the time first.
reaction :: Stage -> IO ()
reaction stage = do
  time >>= writeIORef (reactedAt stage)
  STM.atomically (writeTVar (flag stage) False)

-- | Changes the condition repeatedly, each time after a short pause.
measured :: String -> (Stage -> IO ()) -> String -> IO ()
measured variant reacts load = do
  stage <- Stage <$> newTVarIO False <*> newEmptyMVar <*> newIORef 0
  _ <- forkIO (reacts stage)
  takeMVar (ready stage)
  let sample = do
        _ <- usleep 300
        changed <- time
        STM.atomically (writeTVar (flag stage) True)
        takeMVar (ready stage)
        reacted <- readIORef (reactedAt stage)
        pure ((reacted - changed) / 1000)
  _ <- during 0.2 sample
  sorted <- sort <$> during 3 sample
  for_ [("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999)] $ \(name, part) ->
    line (unwords ["reaction", load, name, variant]) (quantile part sorted)

-- | Repeats the action for the given number of seconds. The loop needs no stack, because the
-- runtime walks through the stack of a thread that blocks, before the next thread runs.
during :: Double -> IO a -> IO [a]
during seconds act = do
  begun <- time
  let go results = do
        result <- act
        over <- (> begun + seconds * 1e9) <$> time
        (if over then pure else go) (result : results)
  go []

-- | Waits as the driver of a device does: outside GHC's runtime, whose threads are all idle
-- meanwhile, and without its timers, which the sleeping task may use too.
foreign import ccall safe "usleep" usleep :: CUInt -> IO CInt

-- | Other agents, for which nothing changes.
crowd :: Int -> IO ()
crowd n = when (n > 0) $ do
  latch <- newLatch n
  replicateM_ n (newAgent >>= \agent -> forkIO (mission agent (countDown latch)))
  awaitLatch latch

-- | A search that allocates all the time, and keeps little alive: all ways to place the queens.
searching :: IO ()
searching = for_ (cycle [6, 7, 8]) $ evaluate . length . queens

queens :: Int -> [[Int]]
queens n = go n
 where
  go 0 = [[]]
  go k = [q : others | others <- go (k - 1 :: Int), q <- [1 .. n], and (zipWith (apart q) others [1 ..])]
  apart q other distance = q /= other && abs (q - other) /= distance

-- | A calculation that allocates little: it can be interrupted every few microseconds.
counting :: IO ()
counting = for_ [1 ..] $ evaluate . steps 10000

-- | Steps of a random number generator.
steps :: Int -> Int -> Int
steps n seed
  | n == 0 = seed
  | otherwise = steps (n - 1) (seed * 6364136223846793005 + 1442695040888963407)
{-# NOINLINE steps #-}
