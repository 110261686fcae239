{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The watchdog, which checks the running simulations in real time: a thread that waits outside of
-- this library, or never returns the turn, would block its whole simulation.
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
import System.CPUTime (getCPUTime)
import System.IO (hFlush, hPutStrLn, stderr)
import System.IO.Unsafe (unsafePerformIO)

import Behavior.Internal.Core.OsSleep
import Behavior.Internal.Core.Seconds (Seconds (..))
import Behavior.Internal.Sim.State
import Behavior.Internal.Sim.Turn (waitingTasks)
import Behavior.Internal.Sim.Types

-- | The simulations to check. (This keeps them alive. Otherwise GHC would find their threads deadlocked,
-- because only threads that wait themselves can wake them.)
watchedSims :: IORef (Map Int Sim, Bool)
watchedSims = unsafePerformIO (newIORef (Map.empty, False))
{-# NOINLINE watchedSims #-}

-- | Runs the action while the watchdog checks the simulation, which has this number.
watched :: Int -> Sim -> IO a -> IO a
watched n sim = bracket_ enter (change (\(sims, awake) -> ((Map.delete n sims, awake), ())))
 where
  enter = do
    awake <- change (\(sims, awake) -> ((Map.insert n sim sims, True), awake))
    unless awake $ do
      (here, _) <- threadCapability =<< myThreadId
      -- On another capability, if there is one: a task may keep this one busy.
      void (mask_ (forkOn (here + 1) (onward (Clock 0 0 0) >>= watchLoop Map.empty 0)))

change :: ((Map Int Sim, Bool) -> ((Map Int Sim, Bool), b)) -> IO b
-- (The map is forced: a thunk would keep simulations that have ended alive.)
change f = atomicModifyIORef' watchedSims (\old -> case f old of new@((sims, _), _) -> sims `seq` new)

-- | What the watchdog knows of a simulation.
data Sample = Sample
  { atPoint :: !Int
  , waits :: !Int
  -- ^ At how many checks it was at this point, and its thread waited outside of the simulation.
  , since :: !Double
  -- ^ The time of the first check.
  , reported :: !Bool
  -- ^ Whether the watchdog has ended the run.
  , warned :: !Bool
  -- ^ Whether the warning that the thread cannot be stopped was printed.
  }

-- | The real time, the processor time of the process, and the real time that counts.
data Clock = Clock !Double !Double !Double

-- | A time in which the process did not run does not count: it was stopped (by Ctrl-Z), the machine was suspended, or
-- other programs had the processors. (It runs at each check, or else computes.)
onward :: Clock -> IO Clock
onward (Clock before usedBefore counted) = do
  t <- getMonotonicTime
  used <- (/ 1e12) . fromIntegral <$> getCPUTime
  pure (Clock t used (counted + min (t - before) (max 0.25 (used - usedBefore))))

-- | Checks every few milliseconds, as long as there are simulations.
watchLoop :: Map Int Sample -> Int -> Clock -> IO ()
watchLoop seen idle before = do
  osSleep 5000
  clock@(Clock _ _ t) <- onward before
  (sims, _) <- readIORef watchedSims
  if Map.null sims && idle > 20
    then do
      go <- change (\(left, _) -> if Map.null left then ((left, False), False) else ((left, True), True))
      when go (watchLoop seen 0 clock)
    else do
      samples <- Map.traverseWithKey (\n sim -> check t sim (Map.lookup n seen)) sims
      let later = if Map.null sims then idle + 1 else 0
      later `seq` watchLoop samples later clock -- a thunk would keep the samples

check :: Double -> Sim -> Maybe Sample -> IO Sample
check t sim before = do
  n <- readIORef (counter sim)
  runner <- readIORef (current sim)
  status <- maybe (pure ThreadFinished) threadStatus (taskThread runner)
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
          endWith verdict sample {warned = hopeless}
      | n == atPoint sample, Just how <- blocked status -> do
          ran <- isResponsive sim
          let seen = if ran then sample {waits = waits sample + 1} else sample
          -- A task that is being unwound, but waits outside of the simulation, is abandoned.
          when (waits seen >= 400) (void (tryPutMVar (driverTurn sim) ()))
          if waits seen < 100
            then pure seen
            else
              waitingTasks sim ((/= taskNumber runner) . taskNumber) >>= \waiting ->
                endWith (BlockedOutside (taskLabel runner) (how waiting)) seen
      | otherwise -> pure sample {atPoint = n, waits = 0}
 where
  Seconds allowed = realTimeLimit (options sim)
  endWith verdict sample = do
    unless (reported sample) (void (tryPutMVar (runEnd sim) (Just verdict)))
    pure sample {reported = True}

-- | Whether the simulation's capability has run the thread that the last call put at the end of its
-- queue. If not, the machine is slow, and the turn may be about to be passed on.
isResponsive :: Sim -> IO Bool
isResponsive sim = do
  ran <- readIORef (responded sim)
  when ran $ do
    writeIORef (responded sim) False
    void . mask_ $ forkOn (capability sim) (writeIORef (responded sim) True)
  pure ran

-- | How a thread waits outside of the simulation, given what the other threads wait for. (Foreign
-- calls are allowed, and so is waiting for a value that another thread computes: that ends by
-- itself, or else at the limit of real time.)
blocked :: ThreadStatus -> Maybe ([Waiting] -> Blocked)
blocked (ThreadBlocked reason) = case reason of
  BlockedOnMVar -> Just (const InMVar)
  BlockedOnSTM -> Just (const InTransaction)
  BlockedOnException -> Just InThrowing
  BlockedOnOther -> Just (const Elsewhere)
  _ -> Nothing
blocked _ = Nothing

-- | Prints a possible reason why the process hangs: a thread that does not allocate cannot receive
-- the exception that stops it, and GHC's next garbage collection waits for the thread.
warn :: Task -> IO ()
warn runner = do
  hPutStrLn stderr $
    "simulate: " ++ show (taskLabel runner) ++ " cannot be stopped. Does it compute without allocating? "
      ++ "Then compile its module with -fno-omit-yields."
  hFlush stderr
