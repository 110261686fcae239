{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The seam: everything that an operator does with threads, time and blocking goes through this module. Except for
-- the modules below it and the simulator, no module forks, delays, throws to a thread or blocks in a transaction. So
-- a simulation that replaces the operations of this module replaces all of them. (Two modules start threads that are
-- part of no simulation: "Behavior.Internal.Tracing.Sink", and "Behavior.Internal.Program.ProcessSignals" for the
-- handlers of the process. @.ci\/lint@ checks that there is no other.)
--
-- Each operation is dispatched to one of two backends: the real one, or the simulation that
-- the calling thread is part of ("Behavior.Internal.Core.Dispatch").
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Seam.Runtime
  ( -- * Threads
    module Behavior.Internal.Seam.Thread

    -- * Waiting
  , atomically
  , awaitUninterruptibly
  , tryReadThenBlock
  , checkpoint
  , yieldReal

    -- * Time
  , Seconds (..)
  , now
  , sleep
  , sleepWithOwnTimer
  , sleepUntil
  , sleepToSlot

    -- * Recording
  , annotate
  , reportUncaught
  , isRecorded
  , announce
  , announceStart
  , simulatedRun
  , keepInRun
  , currentProperty
  ) where

import Control.Concurrent (getNumCapabilities, threadDelay, yield)
import Control.Concurrent.STM (STM)
import qualified Control.Concurrent.STM as STM
import Control.Exception
  ( BlockedIndefinitelyOnSTM (..)
  , Exception (toException)
  , try
  , uninterruptibleMask_
  )
import Control.Monad (when)
import GHC.Clock (getMonotonicTime)
import GHC.Conc (getUncaughtExceptionHandler)

import Behavior.Internal.Core.Backend
import Behavior.Internal.Core.Dispatch
import Behavior.Internal.Core.Property
import Behavior.Internal.Core.Seconds
import Behavior.Internal.Seam.Thread
import qualified Behavior.Internal.Seam.TimerWheel as Timer

-- | Runs a transaction; while it retries, blocks without using the processor.
--
-- Like stm's 'Control.Concurrent.STM.atomically', but visible to the simulator
-- ("Behavior.Sim"); use it instead. Like every operation that blocks, it can be cancelled even
-- where exceptions are masked.
--
-- >>> import Control.Concurrent.STM (newTVarIO, readTVar)
-- >>> battery <- newTVarIO 80
-- >>> atomically (readTVar battery)
-- 80
--
-- @since 0.1.0.0
atomically :: STM a -> IO a
atomically transaction = inSimulation (STM.atomically transaction) simulated
 where
  simulated simulation = transact simulation transaction

-- | Tries to read, yields, tries again, then blocks. Most branches have ended after one yield,
-- and to block in a transaction costs more than to yield.
--
-- With several capabilities it does not yield: GHC would move one of the threads that can then run
-- to another capability, and they would wake each other from there, which takes much longer.
--
-- What the first action reads must be what the second would have given at some moment
-- meanwhile: it should read one variable only. (In a simulation only the second is run.)
tryReadThenBlock :: IO (Maybe a) -> IO a -> IO a
tryReadThenBlock tryRead block = inSimulation tryTwice (const (pure Nothing)) >>= maybe block pure
 where
  tryTwice = tryRead >>= maybe tryAgain (pure . Just)
  tryAgain = getNumCapabilities >>= \n -> if n == 1 then yield >> tryRead else pure Nothing

-- | Waits uninterruptibly. It waits again when GHC takes the thread for deadlocked: GHC does
-- that also while the cleanup that the thread waits for handles the same exception.
awaitUninterruptibly :: IO a -> IO a
awaitUninterruptibly block = uninterruptibleMask_ again
 where
  again = try block >>= either (\BlockedIndefinitelyOnSTM -> again) pure

-- | A point at which other threads may run, and at which a pending cancellation is received,
-- if the masking state allows it.
--
-- In reality every moment is such a point, and this does nothing. In a simulation only
-- this library's operations are: put a checkpoint wherever else it matters (before and
-- after a call to hardware, say).
--
-- >>> checkpoint
--
-- @since 0.1.0.0
checkpoint :: IO ()
checkpoint = inSimulation (pure ()) pause

-- | Yields to threads that were just started or interrupted: so the caller need not block for what
-- they do at once. (In a simulation it does nothing: the schedule decides which thread runs.)
yieldReal :: IO ()
yieldReal = inSimulation yield (const (pure ()))

-- | The time, in seconds since some fixed moment of this run of the program. It
-- never goes backwards, and is not the time of day.
--
-- >>> before <- now
-- >>> after <- now
-- >>> after >= before
-- True
--
-- @since 0.1.0.0
now :: IO Seconds
now = inSimulation (Seconds <$> getMonotonicTime) clock

-- | Waits for at least the given number of seconds, without using the processor.
--
-- Zero returns at once; with an infinite number it sleeps until it is cancelled. A
-- negative number or NaN is refused with an 'ErrorCall' (a fault).
--
-- >>> sleep 0.001
--
-- >>> sleep (-1)
-- *** Exception: sleep: a duration is zero or more seconds, not -1.0
--
-- @since 0.1.0.0
sleep :: Seconds -> IO ()
sleep seconds = do
  _ <- duration "sleep" seconds
  when (seconds > 0) $ now >>= \t -> sleepBetween t (t + seconds)

-- | 'sleep' of at most a day, for a thread that is hardly ever interrupted, in a process that may be idle otherwise:
-- it has a timer of its own, so nothing is woken before its end. (Others are woken after 1, 2, 4 s and so on, and each
-- time GHC's runtime ticks for a while, and looks for garbage.)
sleepWithOwnTimer :: Seconds -> IO ()
sleepWithOwnTimer seconds =
  inSimulation (threadDelay (ceiling (min 86400 seconds * 1000000))) (const (sleep seconds))

-- | Sleeps until a point in time on the clock of 'now'; returns at once if that has passed.
--
-- > sleep s  =  now >>= \t -> sleepUntil (t + s)
--
-- With an infinite number it sleeps until it is cancelled. NaN is refused with an 'ErrorCall' (a
-- fault). For a behaviour with a deadline there is 'Behavior.Time.timeoutAt'.
--
-- >>> started <- now
-- >>> sleepUntil (started + 0.001)
--
-- @since 0.1.0.0
sleepUntil :: Seconds -> IO ()
sleepUntil seconds = do
  end@(Seconds time) <- moment "sleepUntil" seconds
  inSimulation (getMonotonicTime >>= \t -> Timer.sleepBetween t time) (`await` end)

-- | Sleeps until the second moment. The first is the current time.
sleepBetween :: Seconds -> Seconds -> IO ()
sleepBetween (Seconds t) end@(Seconds time) = inSimulation (Timer.sleepBetween t time) (`await` end)

-- | Sleeps until a slot begins, and gives the time when it begins. The arguments are the
-- period, the current time, and when the slot should begin (in reality it may begin a little
-- later: see 'Timer.sleepToSlot'). A slot that has already begun is not waited for.
sleepToSlot :: Seconds -> Seconds -> Seconds -> IO Seconds
sleepToSlot (Seconds every) (Seconds t) slot@(Seconds time)
  | time <= t = pure slot
  | otherwise =
      inSimulation (Seconds <$> Timer.sleepToSlot every t time) (\simulation -> slot <$ await simulation slot)

-- | Adds the text to the simulation's record.
annotate :: String -> IO ()
annotate text = inSimulation (pure ()) (`recordNote` text)

-- | Keeps a mistake that makes a simulated run void: the run ends with it, also if the behaviour catches it.
keepInRun :: Exception e => e -> IO ()
keepInRun e = inSimulation (pure ()) (`recordMistake` toException e)

-- | Passes an exception, which is not thrown, to GHC's handler for uncaught exceptions. In a
-- simulation its text is added to the record instead.
reportUncaught :: Exception e => e -> IO ()
reportUncaught e =
  inSimulation (getUncaughtExceptionHandler >>= ($ toException e)) $ \simulation ->
    recordNote simulation (show e)

-- | Whether what happens belongs to the record by which a run is judged. After the end of a simulated
-- run its remaining threads are unwound; that does not belong to the record.
isRecorded :: IO Bool
isRecorded = inSimulation (pure True) recording

-- | Passes to the simulation what an operator with this name, which begins here, can start. (@""@: the
-- scripted actions of a world.)
announce :: String -> [String] -> IO ()
announce operator branches = inSimulation (pure ()) (\simulation -> recordStartable simulation operator branches)
{-# INLINE announce #-}

-- | Notes in the simulation that this scripted action has been started.
announceStart :: String -> IO ()
announceStart action = inSimulation (pure ()) (\simulation -> recordStarted simulation (Label "" action))

-- | The simulation that the calling thread is part of: its number, and how to read its clock, later too.
simulatedRun :: IO (Maybe (Int, IO Seconds))
simulatedRun = inSimulation (pure Nothing) (\simulation -> pure (Just (runNumber simulation, lookAtClock simulation)))

-- | The property of an exploration that the calling thread is part of.
currentProperty :: IO (Maybe Property)
currentProperty = inSimulation threadProperty (pure . propertyOf)
