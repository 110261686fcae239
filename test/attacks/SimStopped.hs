-- | A process is stopped while it simulates, for longer than the limit of real time.
-- Expected: the time in which it was stopped does not count; as much time in which it computes does.
module SimStopped (attack) where

import Control.Monad (unless, when)
import GHC.Clock (getMonotonicTime)
import System.Exit (ExitCode (..))
import System.Posix.Process (ProcessStatus (..), exitImmediately, forkProcess, getProcessStatus)
import System.Posix.Signals (sigCONT, sigSTOP, signalProcess)

import Attack
import Behavior.Sim

attack :: IO ()
attack = do
  stopped <- simulating True
  unless (stopped == ExitSuccess) $ broken "the time in which the process was stopped has counted"
  computing <- simulating False
  unless (computing == ExitFailure 2) $ broken "the time in which the process computed has not counted"

-- | How a process ends that simulates for 4 s, and may compute for 3 s, if it is stopped for most of that time; or if
-- it is not.
simulating :: Bool -> IO ExitCode
simulating isStopped = do
  child <- forkProcess $ do
    begun <- getMonotonicTime
    run <- simulateWith defaultSimOptions {realTimeLimit = 3} (computeUntil (begun + 4))
    exitImmediately $ case outcome run of
      Returned () -> ExitSuccess
      TooSlow _ _ -> ExitFailure 2
      _ -> ExitFailure 3
  when isStopped $ do
    milliseconds 500
    signalProcess sigSTOP child
    milliseconds 3000
    signalProcess sigCONT child
  end <- getProcessStatus True False child
  case end of
    Just (Exited code) -> pure code
    other -> broken (show other)

-- (With one capability, only what allocates lets the watchdog run.)
computeUntil :: Double -> IO ()
computeUntil end = do
  t <- getMonotonicTime
  when (length (show t) < 1000 && t < end) (computeUntil end)
