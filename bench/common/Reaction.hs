-- |
-- A reaction, and the driver of the device that changes its condition: the time from the change
-- to the first step of the recovery.
module Reaction
  ( -- * The reaction
    Probe (..)
  , newProbe
  , reactor
  , reaction

    -- * The changes
  , Gap (..)
  , gaps
  , reactionTimes
  , report
  ) where

import Control.Concurrent.MVar (MVar, newEmptyMVar, putMVar, takeMVar)
import Control.Concurrent.STM (TVar, newTVarIO, readTVar, writeTVar)
import qualified Control.Concurrent.STM as STM
import Data.Foldable (for_)
import Data.IORef (IORef, newIORef, readIORef, writeIORef)
import Data.List (sort)
import Foreign.C.Types (CInt (..), CUInt (..))

import Behavior
import qualified Behavior.Signal as Signal
import Measured

-- | What a reaction uses.
data Probe = Probe
  { flag :: TVar Bool
  -- ^ The condition.
  , ready :: MVar ()
  -- ^ Filled when the next change may be made.
  , reactedAt :: IORef Double
  -- ^ When the latest reaction took its first step.
  }

newProbe :: IO Probe
newProbe = Probe <$> newTVarIO False <*> newEmptyMVar <*> newIORef 0

-- | Interrupts a sleeping task.
reactor :: Probe -> Behavior ()
reactor probe = Signal.monitor (Signal.watching (readTVar (flag probe))) (reaction probe) task
 where
  task = putMVar (ready probe) () >> sleep 3600

-- | Stores the time first.
reaction :: Probe -> IO ()
reaction probe = do
  time >>= writeIORef (reactedAt probe)
  STM.atomically (writeTVar (flag probe) False)

-- | The time between a reaction and the next change: its name, and microseconds. In the longer
-- ones the process is idle, and the processor may be.
data Gap = Gap
  { gapName :: String
  , gapTime :: CUInt
  }

gaps :: [Gap]
gaps = [Gap "hot" 300, Gap "cold" 2000, Gap "colder" 5000]

-- | Changes the condition repeatedly, each time after the gap, for the given number of seconds.
-- The sorted times to the first step, in microseconds.
reactionTimes :: Probe -> Gap -> Double -> IO [Double]
reactionTimes probe gap seconds = do
  takeMVar (ready probe)
  _ <- during 0.2 sample
  sort <$> during seconds sample
 where
  sample = do
    _ <- usleep (gapTime gap)
    changed <- time
    STM.atomically (writeTVar (flag probe) True)
    takeMVar (ready probe)
    reacted <- readIORef (reactedAt probe)
    pure ((reacted - changed) / 1000)

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

-- | Prints the quantiles of the sorted times. Their names are between the given words.
report :: [String] -> String -> [(String, Double)] -> [Double] -> IO ()
report before after shares sorted = for_ shares $ \(name, part) ->
  line (unwords (before ++ [name, after])) (quantile part sorted)
