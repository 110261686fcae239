{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Looks after the simulations that run, by real time: a thread that waits outside of this
-- library, or never gives the turn back, would halt everything.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Watchdog
  ( watched
  ) where

import Control.Concurrent
import Control.Exception (bracket_, mask_)
import Control.Monad (unless, void, when)
import Data.IORef
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import GHC.Clock (getMonotonicTime)
import GHC.Conc (BlockReason (..), ThreadStatus (..), threadStatus)
import System.IO (hFlush, hPutStrLn, stderr)
import System.IO.Unsafe (unsafePerformIO)

import Behavior.Internal.Seconds (Seconds (..))
import Behavior.Internal.Sim.OsSleep
import Behavior.Internal.Sim.State
import Behavior.Internal.Sim.Turn (waitingTasks)
import Behavior.Internal.Sim.Types

-- | The simulations to look after. The watchdog holds on to them: so GHC does not take
-- their threads, which only a waiting thread could wake, for deadlocked.
watchedSims :: IORef (Map Int Sim, Bool)
watchedSims = unsafePerformIO (newIORef (Map.empty, False))
{-# NOINLINE watchedSims #-}

-- | Has the simulation of this number looked after while the action runs.
watched :: Int -> Sim -> IO a -> IO a
watched n sim = bracket_ enter (change (\(sims, awake) -> ((Map.delete n sims, awake), ())))
 where
  enter = do
    awake <- change (\(sims, awake) -> ((Map.insert n sim sims, True), awake))
    unless awake $ do
      (here, _) <- threadCapability =<< myThreadId
      -- On another capability, if there is one: this one may be kept busy.
      void (mask_ (forkOn (here + 1) (watchLoop Map.empty 0)))

change :: ((Map Int Sim, Bool) -> ((Map Int Sim, Bool), b)) -> IO b
-- (The map is forced: as a thunk it would keep the simulations that are over.)
change f = atomicModifyIORef' watchedSims (\old -> case f old of new@((sims, _), _) -> sims `seq` new)

-- | What was seen of a simulation.
data Sample = Sample
  { atPoint :: !Int
  , waits :: !Int
  -- ^ How often it was seen there, waiting elsewhere.
  , since :: !Double
  -- ^ When it was first seen at all.
  , reported :: !Bool
  -- ^ Whether its run was ended for that.
  , warned :: !Bool
  -- ^ Whether it was said that this did not help.
  }

-- | Looks every few milliseconds, for as long as there is something to look after.
watchLoop :: Map Int Sample -> Int -> IO ()
watchLoop seen idle = do
  osSleep 5000
  (sims, _) <- readIORef watchedSims
  if Map.null sims && idle > 20
    then do
      go <- change (\(now', _) -> if Map.null now' then ((now', False), False) else ((now', True), True))
      when go (watchLoop seen 0)
    else do
      samples <- Map.traverseWithKey (\n sim -> look sim (Map.lookup n seen)) sims
      watchLoop samples $! if Map.null sims then idle + 1 else 0 -- a thunk would keep them

look :: Sim -> Maybe Sample -> IO Sample
look sim before = do
  n <- readIORef (counter sim)
  runner <- readIORef (current sim)
  status <- maybe (pure ThreadFinished) threadStatus (taskThread runner)
  t <- getMonotonicTime
  case before of
    Nothing -> pure (Sample n 0 t False False)
    Just sample
      | t - since sample > allowed -> do
          came <- readIORef (time sim)
          let verdict
                | status == ThreadBlocked BlockedOnBlackHole = BlockedOutside (taskLabel runner) InThunk
                | otherwise = TooSlow (taskLabel runner) came
              hopeless = t - since sample > allowed + 5
          when (hopeless && not (warned sample)) (warn runner)
          tell sample {warned = hopeless} verdict
      | n == atPoint sample, Just how <- blocked status -> do
          ran <- isResponsive sim
          let seen = if ran then sample {waits = waits sample + 1} else sample
          -- Whoever was to be unwound, and waits elsewhere for it, is left behind.
          when (waits seen >= 400) (void (tryPutMVar (driverTurn sim) ()))
          if waits seen < 100
            then pure seen
            else waitingTasks sim ((/= taskNumber runner) . taskNumber) >>= tell seen . BlockedOutside (taskLabel runner) . how
      | otherwise -> pure sample {atPoint = n, waits = 0}
 where
  Seconds allowed = realTimeLimit (options sim)
  tell sample verdict = do
    unless (reported sample) (void (tryPutMVar (runEnd sim) (Just verdict)))
    pure sample {reported = True}

-- | Whether the simulation's capability has run what was put at the end of its queue when this
-- was asked last. If not, the machine is late, perhaps just while the turn is handed on.
isResponsive :: Sim -> IO Bool
isResponsive sim = do
  ran <- readIORef (responded sim)
  when ran $ do
    writeIORef (responded sim) False
    void . mask_ $ forkOn (capability sim) (writeIORef (responded sim) True)
  pure ran

-- | In what a thread waits, while the others wait for what is given. (Foreign calls are
-- allowed, and to wait for what another thread computes: that ends by itself, or else runs into
-- the limit of real time.)
blocked :: ThreadStatus -> Maybe ([Waiting] -> Blocked)
blocked (ThreadBlocked reason) = case reason of
  BlockedOnMVar -> Just (const InMVar)
  BlockedOnSTM -> Just (const InTransaction)
  BlockedOnException -> Just InThrowing
  BlockedOnOther -> Just (const Elsewhere)
  _ -> Nothing
blocked _ = Nothing

-- | Note why the process hangs, perhaps: one that does not allocate does not hear that it should
-- stop, and GHC's next garbage collection waits for it.
warn :: Task -> IO ()
warn runner = do
  hPutStrLn stderr $
    "simulate: " ++ show (taskLabel runner) ++ " does not hear that it should stop. Does it compute without allocating? "
      ++ "Then compile its module with -fno-omit-yields."
  hFlush stderr
