-- |
-- Simulation: what your robot does at the one bad moment, tried out.
--
-- 'simulate' runs a behaviour in virtual time: an hour's sleep takes no time at all, and
-- the same schedule gives the same run, to the step. 'explore' runs it under many
-- schedules, and when one fails, shrinks it and tells what happened:
--
-- >>> import Behavior
-- >>> import Behavior.Time (atomically, now)
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
-- shrunk to one switch, this happens:
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
-- The same behaviours are simulated that run on the robot: plain 'IO', whose waiting goes
-- through this library. "Behavior.Sim.Mock" has actions, conditions and sensors to take
-- the hardware's place; the tutorial is @docs\/testing-a-robot.md@.
--
-- = How it works
--
-- One thread runs at a time. Before each operation of this library (to start or to stop a
-- thread, 'Behavior.Time.atomically', 'Behavior.sleep', 'Behavior.Time.now',
-- 'Behavior.Time.checkpoint', and the end of a thread) another may run. The virtual time moves
-- on when no thread can.
--
-- A cancellation arrives where GHC raises it: unmasked at these operations and before the
-- end of a thread; masked only where the operation has to wait, or else at the very moment
-- when the thread unmasks, also if no operation follows. ('Control.Exception.throwTo' is not
-- simulated, but what this library's operators throw is.)
--
-- = What is not simulated
--
-- Every simulated run is possible on real threads, but not the other way round:
--
-- * What happens between two operations is done in one go: nothing comes in between, and no
--   cancellation arrives there. Put a 'Behavior.Time.checkpoint' where in between it
--   matters: before and after a call to hardware, say.
-- * Waiting by other means ('Control.Concurrent.threadDelay', an @MVar@, threads of
--   @forkIO@ or @async@) is not simulated. A run that waits so is ended, and 'explain' says what to use
--   instead. (If it waits for less than half a second, that goes
--   unnoticed. So does 'System.Timeout.timeout' around something that is simulated: it counts
--   real time.) To print is fine, as long as somebody reads.
-- * Computing takes no time, and timers are exact, unless 'slip' says otherwise.
-- * Clocks, random numbers and finalizers of your own are as they are.
--
-- A loop that never allocates can be stopped by nobody: the process hangs, as it would without
-- a simulation. (With a second capability, @+RTS -N2@, a line on @stderr@ names the thread,
-- five seconds after 'realTimeLimit' has run out.) Compile it with @-fno-omit-yields@, and the run
-- ends with 'TooSlow'.
--
-- (Schedules are fastest with one capability and large enough stacks: @+RTS -N1 -ki2k@.)
module Behavior.Sim
  ( -- * One run
    simulate
  , simulateWith
  , Options (..)
  , defaults
  , Schedule (..)

    -- * What came of it
  , Run (..)
  , Outcome (..)
  , explain
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

import Behavior.Internal.Runtime.Backend (Label (..))
import Behavior.Internal.Sim.Explore
import Behavior.Internal.Sim.Plan
import Behavior.Internal.Sim.Report
import Behavior.Internal.Sim.Simulate
import Behavior.Internal.Sim.Types
