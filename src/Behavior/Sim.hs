-- |
-- Simulation: tests of a behaviour in virtual time, under many schedules.
--
-- 'simulate' runs a behaviour in virtual time: an hour's sleep takes no real time, and the
-- same schedule gives the same steps. 'explore' runs it under many schedules; when the test
-- fails under one of them, 'explore' shrinks that schedule and shows its steps:
--
-- >>> import Behavior
-- >>> import Behavior.STM (atomically)
-- >>> import Behavior.Time (now)
-- >>> import Control.Concurrent.STM (newTVarIO, readTVar, readTVarIO, writeTVar)
--
-- >>> run <- simulate (both (sleep 3600) (sleep 1800) >> now)
-- >>> finished run
-- 3600.0
--
-- >>> :{
-- explore (randomly 1000) $ \simulate -> do
--   count <- newTVarIO (0 :: Int)
--   let pickUp = atomically (readTVar count) >>= \n -> atomically (writeTVar count (n + 1))
--   _ <- simulate (both pickUp pickUp)
--   n <- readTVarIO count
--   if n == 2 then pure () else fail ("two boxes were picked up, and it counted " ++ show n)
-- :}
-- *** Exception: schedule 18 fails:
--   user error (two boxes were picked up, and it counted 1)
-- shrunk to one pre-emption, this happens:
--      0.000 s  0 main         transaction
--      0.000 s  1 both: left   starts
--      0.000 s  1 both: left   transaction
--      0.000 s  1 both: left   -- another thread runs first
--      0.000 s  2 both: right  starts
--      0.000 s  2 both: right  transaction
--      0.000 s  2 both: right  ends
--      0.000 s  1 both: left   ends
--      0.000 s  0 main         transaction
-- to see it again: explore (replaying (Preempting [(5,2)]))
--
-- The simulated behaviour is the one that runs on the robot: plain 'IO' that blocks only in
-- operations of this library. "Behavior.Sim.Mock" has actions, conditions and sensors that
-- replace the hardware; the tutorial is @docs\/testing-a-robot.md@.
--
-- = How it works
--
-- One thread runs at a time. There is a /scheduling point/ before each operation of this
-- library (to start or to stop a thread, 'Behavior.STM.atomically', 'Behavior.sleep',
-- 'Behavior.Time.now', 'Behavior.Time.checkpoint') and before the end of a thread: there
-- another thread may run. The virtual time advances when no thread is enabled.
--
-- A cancellation is received where GHC raises it. An unmasked thread receives it at these
-- operations and before its end. A masked thread receives it only where the operation has to
-- wait, or else as soon as the thread unmasks, even if no operation follows.
-- ('Control.Exception.throwTo' is not simulated, but the exceptions that this library's
-- operators throw are.)
--
-- = What is not simulated
--
-- Every simulated run is possible on real threads. Not every real run can be simulated:
--
-- * The code between two operations is one step: no other thread runs in between, and no
--   cancellation is received there. Put a 'Behavior.Time.checkpoint' where that matters, for
--   example before and after a call to hardware.
-- * Waiting by other means ('Control.Concurrent.threadDelay', an @MVar@, threads of
--   @forkIO@ or @async@) is not simulated. A run that waits like this is ended, and 'explain'
--   names what to use instead. (A wait of less than half a second is not detected. Neither is
--   'System.Timeout.timeout' around a simulated operation: it counts real time.) Printing is
--   fine, as long as the output is read.
-- * Computing takes no virtual time, and timers are exact, unless 'timerSlip' is set.
-- * Your own clocks, random numbers and finalizers are not simulated.
--
-- A loop that never allocates cannot be stopped: the process hangs, as it would without a
-- simulation. (With a second capability, @+RTS -N2@, a line on @stderr@ names the thread, five
-- seconds after 'realTimeLimit' has run out.) Compile the loop with @-fno-omit-yields@, and
-- the run ends with 'TooSlow'.
--
-- (Schedules are fastest with one capability and large enough stacks: @+RTS -N1 -ki2k@.)
module Behavior.Sim
  ( -- * One run
    simulate
  , simulateWith
  , SimOptions (..)
  , defaultSimOptions
  , Schedule (..)

    -- * The result of a run
  , Run (..)
  , Outcome (..)
  , explain
  , well
  , Waiting (..)
  , Blocked (..)
  , Step (..)
  , StepKind (..)
  , Label (..)
  , renderSteps
  , ofThreads
  , mentioning

    -- * Many runs
  , explore
  , tryExplore
  , Plan (..)
  , Search (..)
  , randomly
  , exhaustively
  , replaying
  , endingAt
  , Report (..)
  , Counterexample (..)
  , renderSchedule
  ) where

import Behavior.Internal.Core.Backend (Label (..))
import Behavior.Internal.Sim.Explore
import Behavior.Internal.Sim.Plan
import Behavior.Internal.Sim.Report
import Behavior.Internal.Sim.Simulate
import Behavior.Internal.Sim.Types
