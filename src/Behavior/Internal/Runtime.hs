{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE CPP #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE RankNTypes #-}

-- |
-- The seam: all that the library does with threads, time and waiting goes through
-- this module. No other module (but the clock that it sleeps by,
-- "Behavior.Internal.Runtime.TimerWheel") forks, delays, throws to a thread or waits in a
-- transaction, so a simulation that takes over here has taken over everything.
--
-- Each operation is done in reality, or in the simulation that the calling thread
-- is part of ("Behavior.Internal.Runtime.Dispatch").
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

    -- * Watching
  , Event (..)
  , annotate
  , isRecorded
  , runClock
  , withSink
  ) where

import Control.Concurrent (ThreadId, forkIO, myThreadId, throwTo, yield)
import Control.Concurrent.Async (Async, asyncThreadId, asyncWithUnmask)
import Control.Concurrent.STM (STM, TVar)
import qualified Control.Concurrent.STM as STM
import Control.Exception
  ( BlockedIndefinitelyOnSTM (..)
  , Exception (toException)
  , SomeException
  , bracket_
  , onException
  , try
  , uninterruptibleMask_
  )
import Control.Monad (when)
import Data.Foldable (for_)
import Data.IORef (IORef, newIORef, readIORef, writeIORef)
import GHC.Clock (getMonotonicTime)
import GHC.Conc (labelThread)
import GHC.IORef (atomicModifyIORef'_)
import System.IO.Unsafe (unsafePerformIO)

#if !MIN_VERSION_base(4,18,0)
import GHC.RTS.Flags (DoTrace (..), TraceFlags (tracing), getTraceFlags)
#endif

import Behavior.Internal.Runtime.Backend
import Behavior.Internal.Runtime.Counter
import Behavior.Internal.Runtime.Dispatch
import qualified Behavior.Internal.Runtime.TimerWheel as Alarm
import Behavior.Internal.Seconds

-- | A thread that the library has started, and what it publishes as it ends.
--
-- (Not an @Async r@: to read the result of that without blocking takes a transaction, and the
-- transaction that publishes it writes nothing else.)
data Thread r = Thread
  { threadAsync :: {-# UNPACK #-} !(Async ())
  , threadResult :: {-# UNPACK #-} !(TVar (Maybe r))
  -- ^ Nothing until it has ended, cleanup included.
  }

threadId :: Thread r -> ThreadId
threadId = asyncThreadId . threadAsync

-- | What the thread published; retries until it has ended.
threadEnd :: Thread r -> STM r
threadEnd thread = tryReadEndSTM thread >>= maybe STM.retry pure

-- | What the thread has published, if it has ended.
tryReadEndSTM :: Thread r -> STM (Maybe r)
tryReadEndSTM = STM.readTVar . threadResult

-- | The same, at a glance.
tryReadEnd :: Thread r -> IO (Maybe r)
tryReadEnd = STM.readTVarIO . threadResult

-- | Starts a thread in which the action runs unmasked, whatever the caller's
-- masking state, and which publishes how that ended. Call it masked, or the thread may be
-- lost before it is returned.
start :: Label -> IO a -> IO (Thread (Either SomeException a))
start = startWith pure (\_ -> pure ())
{-# INLINE start #-}

-- | The same, but the thread publishes what the first function, which runs in it and masked,
-- makes of how the action ended. The second function is done in the same transaction.
--
-- (What is inlined here, and what is not, is so that the switch costs nothing.)
startWith :: (Either SomeException a -> IO r) -> (r -> STM ()) -> Label -> IO a -> IO (Thread r)
startWith finish hook label act = inSimulation (startReally finish hook label act) (startSimulated finish hook label act)
{-# INLINE startWith #-}

startReally :: (Either SomeException a -> IO r) -> (r -> STM ()) -> Label -> IO a -> IO (Thread r)
startReally finish hook label act = do
  result <- STM.newTVarIO Nothing
  add threads 1
  -- The thread is masked, as the caller is: an exception is raised neither before 'try' is in
  -- place, nor between the end of the action and the publication of its outcome.
  thread <- asyncWithUnmask $ \unmask -> do
    end <- runThread emit label (unmask act) >>= finish
    STM.atomically (STM.writeTVar result (Just end) >> hook end)
  pure (Thread thread result)
{-# INLINE startReally #-}

startSimulated :: (Either SomeException a -> IO r) -> (r -> STM ()) -> Label -> IO a -> Simulator -> IO (Thread r)
startSimulated finish hook label act simulation = do
  result <- STM.newTVarIO Nothing
  let report event = emit event >> record simulation event
  thread <- spawn simulation label (\begin unmask -> runThread report label (unmask (begin >> toItsEnd)) >>= finish) $ \end ->
    STM.writeTVar result (Just end) >> hook end
  add threads 1
  pure (Thread thread result)
 where
  -- Between its last operation and its end it can still be stopped, as in reality.
  toItsEnd = act >>= \a -> a <$ pause simulation
{-# NOINLINE startSimulated #-}

-- | What a thread does (it reports as it is told), and how the action ended.
runThread :: (Event -> IO ()) -> Label -> IO a -> IO (Either SomeException a)
runThread report label act = do
  when labelling (labelSelf label)
  report (Started label)
  end <- try act
  report (Ended label)
  add threads (-1)
  pure end
{-# INLINE runThread #-}

-- | The calling thread has this label from now on.
labelSelf :: Label -> IO ()
labelSelf label = myThreadId >>= \self -> labelThread self (show label)
{-# NOINLINE labelSelf #-}

-- | Whether labels can be seen by anybody. Before GHC 9.6 only an event log shows them,
-- and to label a thread costs more than to start it.
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

-- | Throws an exception to a thread, and returns when that has heard it or has ended. A
-- thread in an uninterruptible cleanup is slow to hear; whoever waits for it can be
-- interrupted, and then has thrown nothing.
interrupt :: Exception e => ThreadId -> e -> IO ()
interrupt thread e =
  inSimulation (throwTo thread e) (\simulation -> deliver simulation thread (toException e))

-- | 'interrupt' for a caller that then waits for the end of the thread. It is not withdrawn: if
-- the caller is interrupted before the thread has heard, a messenger goes on. Call it masked.
throwToOne :: Exception e => ThreadId -> e -> IO ()
throwToOne thread e =
  inSimulation (throwTo thread e `onException` throwToAll (const e) [thread]) $ \simulation ->
    send simulation thread (toException e)

-- | 'interrupt' by messengers, who do the waiting: none of the threads hears it later
-- because another is slow to hear.
--
-- One messenger does all the errands, until it has to wait. Then there is another for those
-- that are left: at most as many as there are threads to interrupt.
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
        when labelling $ labelThread helper (show (Label "interrupt" "messenger"))
        yield
        spawnHelper others left
  drain left =
    atomicModifyIORef'_ left (drop 1) >>= \case
      ([], _) -> pure ()
      (thread : _, _) -> throwTo thread (what thread) >> drain left

-- | How many threads started by 'start' have not ended.
liveThreadCount :: IO Int
liveThreadCount = total threads

-- | Runs a transaction, waiting (without using the processor) while it retries.
--
-- It is 'Control.Concurrent.STM.atomically', by the door that this library uses
-- itself: what a behaviour waits for by this door, the library can see. Like
-- every wait it can be cancelled, also where exceptions are masked.
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

-- | Waits, unless a glance makes that needless: of those who wait for each other most are
-- done when they have had their turn, and to wait in a transaction is dear.
--
-- What the glance gives must be what the wait would have given, at some moment meanwhile:
-- it should look at one variable only. (In a simulation there is no glance.)
tryReadThenBlock :: IO (Maybe a) -> IO a -> IO a
tryReadThenBlock tryRead block = inSimulation tryTwice (const (pure Nothing)) >>= maybe block pure
 where
  tryTwice = tryRead >>= maybe (yield >> tryRead) (pure . Just)

-- | A wait that nothing can interrupt. It goes on when GHC takes the thread for deadlocked: GHC
-- does so, too, while the cleanup that the thread waits for handles the same exception.
awaitUninterruptibly :: IO a -> IO a
awaitUninterruptibly block = uninterruptibleMask_ again
 where
  again = try block >>= either (\BlockedIndefinitelyOnSTM -> again) pure

-- | A moment at which the others may run, and a cancellation that is under way
-- arrives, if the masking state allows it.
--
-- In reality that is so at any moment, and this does nothing. In a simulation it
-- is so only where a behaviour does something by this library: put a checkpoint
-- where in between it matters (before and after a call to hardware, say).
--
-- >>> checkpoint
--
-- @since 0.1.0.0
checkpoint :: IO ()
checkpoint = inSimulation (pure ()) pause

-- | Lets those run who were just started, or just asked for something: what they do at
-- once need not be waited for. (In a simulation the schedule says who runs.)
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

-- | Waits for at least so many seconds, without using the processor.
--
-- Zero returns at once; an infinite number sleeps until it is cancelled. A
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

-- | Sleeps until the clock shows the given moment, or a later one.
sleepUntil :: Seconds -> IO ()
sleepUntil moment@(Seconds time) =
  inSimulation (getMonotonicTime >>= \t -> Alarm.sleepBetween t time) (`await` moment)

-- | Sleeps until the second moment. The first is what the clock shows now.
sleepBetween :: Seconds -> Seconds -> IO ()
sleepBetween (Seconds t) moment@(Seconds time) = inSimulation (Alarm.sleepBetween t time) (`await` moment)

-- | Sleeps until a slot of so many seconds begins, and says when that is (in reality perhaps
-- a little later than asked for: see 'Alarm.sleepToSlot'). The second moment is now; a slot
-- that has begun by then is not waited for.
sleepToSlot :: Seconds -> Seconds -> Seconds -> IO Seconds
sleepToSlot (Seconds every) (Seconds t) slot@(Seconds time)
  | time <= t = pure slot
  | otherwise =
      inSimulation (Seconds <$> Alarm.sleepToSlot every t time) (\simulation -> slot <$ await simulation slot)

-- | Reports every event to the given sink while the action runs. The sink is
-- called by the thread that the event is about, masked; it must not block.
withSink :: (Event -> IO ()) -> IO a -> IO a
withSink sink =
  bracket_
    (writeIORef eventSink (Just sink) >> add sinks 1)
    (add sinks (-1) >> writeIORef eventSink Nothing)

-- | Says something that whoever watches should know.
annotate :: String -> IO ()
annotate text = emit (Annotated text) >> inSimulation (pure ()) (\simulation -> record simulation (Annotated text))

-- | Whether what happens now belongs to what a run is judged by. When a simulated run has
-- ended, what is left of it is unwound, which does not.
isRecorded :: IO Bool
isRecorded = inSimulation (pure True) recording

-- | How to look at the clock of the simulation that the calling thread is part of, later too.
runClock :: IO (Maybe (IO Seconds))
runClock = inSimulation (pure Nothing) (pure . Just . lookAtClock)

-- | Reports an event to the sink, if there is one.
emit :: Event -> IO ()
emit event = do
  n <- total sinks
  when (n > 0) (readIORef eventSink >>= \sink -> for_ sink ($ event))
{-# INLINE emit #-}

eventSink :: IORef (Maybe (Event -> IO ()))
eventSink = unsafePerformIO (newIORef Nothing)
{-# NOINLINE eventSink #-}
