{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE CPP #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE RankNTypes #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- The seam: everything that the library does with threads, time and blocking goes through
-- this module. No other module (except what it uses, "Behavior.Internal.Runtime.Fork" and
-- "Behavior.Internal.Runtime.TimerWheel", the simulator, and the threads of a trace's sinks) forks, delays, throws
-- to a thread or blocks in a transaction. So a simulation that replaces the operations of this module replaces all
-- of them.
--
-- Each operation is dispatched to one of two backends: the real one, or the simulation that
-- the calling thread is part of ("Behavior.Internal.Runtime.Dispatch").
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Runtime
  ( -- * Threads
    Label (..)
  , Thread
  , threadId
  , threadEnd
  , tryReadEndSTM
  , tryReadEnd
  , start
  , startWith
  , Placement (..)
  , interrupt
  , throwToOne
  , throwToAll
  , liveThreadCount

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
  , sleepUntil
  , sleepBetween
  , sleepToSlot

    -- * Recording
  , annotate
  , reportUncaught
  , isRecorded
  , announce
  , announceStart
  , simulatedRun
  , Property
  , currentProperty
  , keepMistake
  ) where

import Control.Concurrent
  ( ThreadId
  , forkIO
  , getNumCapabilities
  , myThreadId
  , throwTo
  , yield
  )
import Control.Concurrent.STM (STM, TVar)
import qualified Control.Concurrent.STM as STM
import Control.Exception
  ( BlockedIndefinitelyOnSTM (..)
  , Exception (toException)
  , SomeException
  , catch
  , onException
  , try
  , uninterruptibleMask_
  )
import Control.Monad (when)
import Data.Foldable (for_)
import Data.IORef (newIORef, readIORef)
import GHC.Clock (getMonotonicTime)
import GHC.Conc (getUncaughtExceptionHandler, labelThread)
import GHC.IORef (atomicModifyIORef'_)
import System.IO.Unsafe (unsafePerformIO)

#if !MIN_VERSION_base(4,18,0)
import GHC.RTS.Flags (DoTrace (..), TraceFlags (tracing), getTraceFlags)
#endif

import Behavior.Internal.Runtime.Backend
import Behavior.Internal.Runtime.Counter
import Behavior.Internal.Runtime.Dispatch
import Behavior.Internal.Runtime.Fork
import Behavior.Internal.Runtime.Property
import qualified Behavior.Internal.Runtime.TimerWheel as Timer
import Behavior.Internal.Seconds
import Behavior.Internal.Trace.Place (Place (path), inPath, myPlace)
import Behavior.Internal.Trace.Span (branchSpan)

-- | A thread that the library has started, and what it publishes as it ends.
--
-- (Not an @Async r@: to read the result of that without blocking takes a transaction, the transaction that
-- publishes it writes nothing else, and a branch would take more bytes.)
data Thread r = Thread
  { threadId :: !ThreadId
  -- ^ The thread itself.
  , threadResult :: {-# UNPACK #-} !(TVar (Maybe r))
  -- ^ Nothing until it has ended, cleanup included.
  }

-- | What the thread published; retries until it has ended.
threadEnd :: Thread r -> STM r
threadEnd thread = tryReadEndSTM thread >>= maybe STM.retry pure

-- | What the thread has published, if it has ended.
tryReadEndSTM :: Thread r -> STM (Maybe r)
tryReadEndSTM = STM.readTVar . threadResult

-- | The same outside a transaction. Does not block.
tryReadEnd :: Thread r -> IO (Maybe r)
tryReadEnd = STM.readTVarIO . threadResult

-- | Starts a thread in which the action runs unmasked, whatever the caller's
-- masking state, and which publishes how that ended. Call it masked, or the thread may be
-- lost before it is returned.
start :: Label -> IO a -> IO (Thread (Either SomeException a))
start = startWith Inherited pure (\_ -> pure ())
{-# INLINE start #-}

-- | Like 'start', but the thread publishes the result of the first function, which it applies,
-- masked, to how the action ended. The second function is part of the transaction that
-- publishes. (In a simulation the placement has no effect.)
--
-- (The inlining here is chosen so that the dispatch costs nothing.)
startWith :: Placement -> (Either SomeException a -> IO r) -> (r -> STM ()) -> Label -> IO a -> IO (Thread r)
startWith placement finish hook label act =
  inSimulation (startReally placement finish hook label act) (startSimulated finish hook label act)
{-# INLINE startWith #-}

startReally :: Placement -> (Either SomeException a -> IO r) -> (r -> STM ()) -> Label -> IO a -> IO (Thread r)
startReally placement finish hook label act = do
  result <- STM.newTVarIO Nothing
  add threads 1
  here <- myPlace
  -- The thread is masked, as the caller is: an exception is raised neither before 'try' is in
  -- place, nor between the end of the action and the publication of its outcome.
  thread <- fork placement $ do
    end <- runThread here label (unmasked act) >>= finish
    STM.atomically (STM.writeTVar result (Just end) >> hook end)
  pure (Thread thread result)
{-# INLINE startReally #-}

startSimulated :: (Either SomeException a -> IO r) -> (r -> STM ()) -> Label -> IO a -> Simulator -> IO (Thread r)
startSimulated finish hook label act simulation = do
  result <- STM.newTVarIO Nothing
  here <- myPlace
  let run whole = recordStart simulation >> runThread here label whole >>= finish
  thread <- spawn simulation label (\begin unmask -> run (unmask (begin >> toItsEnd))) $ \end ->
    STM.writeTVar result (Just end) >> hook end
  add threads 1
  pure (Thread thread result)
 where
  -- It can still be stopped between its last operation and its end, as in reality.
  toItsEnd = act >>= \a -> a <$ pause simulation
{-# NOINLINE startSimulated #-}

-- | Runs the action in that place, and gives how it ended.
runThread :: Maybe Place -> Label -> IO a -> IO (Either SomeException a)
runThread here label act = do
  when labelling (labelSelf here label)
  end <- branchSpan label here act
  add threads (-1)
  pure end
{-# INLINE runThread #-}

-- | Labels the calling thread. (What the text of a name throws, of whatever type, must not end it; and
-- a stop request must not be taken for that.)
labelSelf :: Maybe Place -> Label -> IO ()
labelSelf here label =
  uninterruptibleMask_ $
    (myThreadId >>= \self -> labelThread self (show label ++ inPath (maybe [] path here)))
      `catch` \(_ :: SomeException) -> pure ()
{-# NOINLINE labelSelf #-}

-- | Whether labels are visible anywhere. Before GHC 9.6 only an event log shows them,
-- and labelling a thread costs more than starting it.
labelling :: Bool
#if MIN_VERSION_base(4,18,0)
labelling = True
#else
labelling = unsafePerformIO (traced <$> getTraceFlags)
 where
  traced flags = case tracing flags of
    TraceNone -> False
    _ -> True
{-# NOINLINE labelling #-}
#endif

-- | Throws an exception to a thread, and returns when the thread has received it or has ended.
-- A thread in an uninterruptible cleanup receives it after that cleanup. While the caller waits
-- it can be interrupted; then nothing has been thrown.
interrupt :: Exception e => ThreadId -> e -> IO ()
interrupt thread e =
  inSimulation (throwTo thread e) (\simulation -> deliver simulation thread (toException e))

-- | 'interrupt' for a caller that then waits for the end of the thread. It is not withdrawn: if
-- the caller is interrupted before the thread has received the exception, a helper thread
-- throws it. Call it masked.
throwToOne :: Exception e => ThreadId -> e -> IO ()
throwToOne thread e =
  inSimulation (throwTo thread e `onException` throwToAll (const e) [thread]) $ \simulation ->
    send simulation thread (toException e)

-- | 'interrupt' by helper threads, which do the waiting: a thread that receives its exception
-- late does not delay those of the others.
--
-- One helper thread throws to all the targets, until it blocks. Then another is started for the
-- remaining ones: at most as many helpers as there are targets.
throwToAll :: Exception e => (ThreadId -> e) -> [ThreadId] -> IO ()
throwToAll what targets =
  inSimulation byHelpers $ \simulation -> for_ targets $ \thread -> send simulation thread (toException (what thread))
 where
  byHelpers = newIORef targets >>= spawnHelper targets
  spawnHelper [] _ = pure ()
  spawnHelper (_ : others) left =
    readIORef left >>= \case
      [] -> pure ()
      _ -> do
        helper <- forkIO (uninterruptibleMask_ (drain left))
        when labelling $ labelThread helper (show (Label "interrupt" "helper"))
        yield
        spawnHelper others left
  drain left =
    atomicModifyIORef'_ left (drop 1) >>= \case
      ([], _) -> pure ()
      (thread : _, _) -> throwTo thread (what thread) >> drain left

-- | How many threads that were started by 'start', or for a sink of a trace, have not ended.
liveThreadCount :: IO Int
liveThreadCount = total threads

-- | Runs a transaction; while it retries, blocks without using the processor.
--
-- Like stm's 'Control.Concurrent.STM.atomically', but visible to the simulator
-- ("Behavior.Sim"); use it instead. Like every operation that blocks it can be cancelled, also
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

-- | Yields to threads that were just started or interrupted, so that what they do at once need
-- not be waited for. (In a simulation it does nothing: the schedule decides which thread runs.)
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

-- | Sleeps until a point in time on the clock of 'now'; returns at once if that has passed.
--
-- > sleep s  =  now >>= \t -> sleepUntil (t + s)
--
-- With an infinite number it sleeps until it is cancelled. NaN is refused with an 'ErrorCall' (a
-- fault). A deadline for a behaviour is 'Behavior.Time.timeoutAt'.
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
