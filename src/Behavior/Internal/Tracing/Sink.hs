{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE RankNTypes #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Sinks: what receives the events of a trace.
--
-- Each sink has a thread of its own, and a queue that never blocks the threads that emit events: when it is
-- full, the newest event is dropped, and counted. The sinks' threads do not go through the seam: they are
-- outside of every simulation, and never change a schedule.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Tracing.Sink
  ( Sink (..)
  , linesTo
  , SinkProblem (..)

    -- * Running
  , Running
  , start
  , emit
  , end
  ) where

import Control.Concurrent (MVar, forkIO, forkIOWithUnmask, myThreadId, newEmptyMVar, readMVar, takeMVar, tryPutMVar)
import Control.Exception (BlockedIndefinitelyOnMVar (..), Exception (..), SomeException, catch, evaluate, mask_, try)
import Control.Monad (unless, void, when)
import Data.Foldable (for_, traverse_)
import Data.IORef (IORef, atomicModifyIORef', newIORef, readIORef, writeIORef)
import GHC.Clock (getMonotonicTime)
import GHC.Conc (getUncaughtExceptionHandler, labelThread)
import System.IO (Handle, hFlush, hPutStrLn)
import System.Timeout (timeout)

import Behavior.Internal.Core.Counter (add, threads)
import Behavior.Internal.Core.OsSleep (osSleep)
import Behavior.Internal.Core.SafeText (safeShow, settledText)
import Behavior.Internal.Core.Seconds (Seconds (..))
import Behavior.Internal.Core.Stop (displayed)
import Behavior.Internal.Spans.Event
import Behavior.Internal.Spans.Place (inPlace, newTrace, placeIn)
import Behavior.Internal.Tracing.Text (plainLine)

-- | What receives the events of a trace, in the order in which they were emitted. It runs in a thread
-- of its own: it may take its time, and may block.
--
-- @since 0.1.0.0
data Sink
  = -- | Receives one event after the other.
    EachEvent (Event -> IO ())
  | -- | Receives all the events that have come since it last returned; a file is then flushed.
    Batches ([Event] -> IO ())

-- | The sink that prints each event as a line.
--
-- @since 0.1.0.0
linesTo :: Handle -> Sink
linesTo handle = Batches (\batch -> traverse_ (hPutStrLn handle . plainLine) batch >> hFlush handle)

-- | A sink while its trace is made.
data Running = Running
  { queue :: !(IORef Queue)
  , wake :: !(MVar ())
  , closing :: !(MVar ())
  -- ^ Filled when the trace ends.
  , inFlight :: !(IORef Int)
  -- ^ How many events have left the queue, but have not been passed to the sink yet.
  , done :: !(IORef Bool)
  }

-- | The events that the sink's thread has not taken yet.
data Queue = Queue
  { phase :: !Phase
  , size :: !Int
  , newestFirst :: [Event]
  , dropped :: !Int
  -- ^ How many events came after those, and found the queue full.
  , taken :: !Int
  -- ^ How many events (dropped ones included) the sink's thread has taken and not yet written to 'inFlight';
  -- then zero.
  }

-- | How many events the queue accounts for.
produced :: Queue -> Int
produced q = size q + dropped q

-- | What a sink's thread does.
data Phase
  = -- | The thread waits to be woken.
    Idle
  | Busy
  | -- | No event is accepted any more.
    Closed
  | -- | The same; and no event is passed to the sink any more.
    LeftBehind
  deriving (Eq, Ord)

-- | Starts the thread of a sink.
start :: Int -> Sink -> IO Running
start n destination = do
  running <-
    Running
      <$> newIORef (Queue Busy 0 [] 0 0)
      <*> newEmptyMVar
      <*> newEmptyMVar
      <*> newIORef 0
      <*> newIORef False
  add threads 1
  running <$ mask_ (forkIOWithUnmask (work running))
 where
  work :: Running -> (forall a. IO a -> IO a) -> IO ()
  work running unmask = do
    self <- myThreadId
    labelThread self ("withTrace: sink " ++ show n)
    -- What the sink itself does is in another trace, without sinks. (In its own trace each event would make
    -- others, without end.)
    nowhere <- newTrace (Seconds <$> getMonotonicTime)
    try (inPlace (Just (placeIn [] nowhere)) (unmask (drain running destination))) >>= \case
      Left e -> close running >> notify (SinkThrew e)
      Right () -> pure ()
    add threads (-1)
    writeIORef (done running) True

-- | Accepts an event, or counts it as lost if the queue has this size. Neither blocks nor throws.
emit :: Int -> Running -> Event -> IO ()
emit limit running event = do
  mustWake <- event `seq` atomicModifyIORef' (queue running) put
  when mustWake (void (tryPutMVar (wake running) ()))
 where
  put q
    | phase q >= Closed = (q, False)
    | size q >= limit = (q {dropped = dropped q + 1}, False)
    | otherwise = (q {phase = Busy, size = size q + 1, newestFirst = event : newestFirst q}, phase q == Idle)

-- | Passes what is in the queue to the sink, until the trace has ended and the queue is empty. After
-- each batch it waits for ten milliseconds, so that it is seldom woken.
drain :: Running -> Sink -> IO ()
drain running destination = do
  q <- change $ \q ->
    let next = if isEmpty q && phase q == Busy then Idle else phase q
     in (Queue {phase = next, size = 0, newestFirst = [], dropped = 0, taken = produced q}, q)
  if isEmpty q
    then unless (phase q >= Closed) (awaitWake >> drain running destination)
    else do
      writeIORef (inFlight running) (produced q)
      latest <- change (\after -> (after {taken = 0}, phase after))
      unless (latest == LeftBehind) $ do
        pass (size q) (reverse (newestFirst q)) (dropped q)
        _ <- timeout 10000 (readMVar (closing running))
        drain running destination
 where
  change = atomicModifyIORef' (queue running)
  -- When GHC finds a thread of the trace deadlocked, it takes this thread for deadlocked, too. But that thread
  -- may handle the exception, and emit further events.
  awaitWake = takeMVar (wake running) `catch` \BlockedIndefinitelyOnMVar -> awaitWake
  isEmpty q = produced q == 0
  pass n events lost = case destination of
    EachEvent f -> traverse_ (\e -> claiming 1 (settled e >>= f)) events >> for_ lostHere (claiming lost . f)
    Batches f -> claiming (n + lost) (traverse settled events >>= f . (++ lostHere))
   where
    lostHere = [Lost lost | lost > 0]
  -- Unless 'end' has counted these events as lost: then they are not passed.
  claiming k act = do
    isMine <- atomicModifyIORef' (inFlight running) (\n -> if n >= k then (n - k, True) else (n, False))
    when isMine act

-- | The event with all its texts evaluated: users' code computes them.
settled :: Event -> IO Event
settled = traverseTexts (evaluate . settledText)

-- | Accepts no more events.
close :: Running -> IO ()
close running = do
  atomicModifyIORef' (queue running) (\q -> (q {phase = max Closed (phase q)}, ()))
  void (tryPutMVar (closing running) ())
  void (tryPutMVar (wake running) ())

-- | Ends the trace: waits until the sinks have received everything, for at most the given number of
-- seconds. What they have not received then is lost, and reported.
end :: Seconds -> [Running] -> IO ()
end (Seconds limit) running = do
  traverse_ close running
  deadline <- (+ limit) <$> getMonotonicTime
  for_ running $ \r -> awaitUntil deadline (done r) >>= \isDone -> unless isDone (leave r)
 where
  leave r = do
    q <- atomicModifyIORef' (queue r) (\q -> (q {phase = LeftBehind, size = 0, newestFirst = [], dropped = 0}, q))
    passing <- atomicModifyIORef' (inFlight r) ((,) 0)
    notifySoon (SinkLeft (Seconds limit) (produced q + (if taken q > 0 then taken q else passing)))

-- | Waits until the variable is true, or that time has come.
awaitUntil :: Double -> IORef Bool -> IO Bool
awaitUntil deadline variable = looking 100
 where
  looking pause = do
    isTrue <- readIORef variable
    t <- getMonotonicTime
    if isTrue || t >= deadline
      then pure isTrue
      else osSleep pause >> looking (min 5000 (2 * pause))

-- | What is reported of a sink. It is never thrown.
--
-- @since 0.1.0.0
data SinkProblem
  = -- | It threw an exception, and receives nothing more.
    SinkThrew SomeException
  | -- | It was still blocked that many seconds after the end of the trace. Its thread remains, and
    -- that many events were lost.
    SinkLeft Seconds Int

instance Show SinkProblem where
  show = \case
    SinkThrew e -> "withTrace: a sink threw an exception, and receives nothing more: " ++ safeShow (displayed e)
    SinkLeft limit n ->
      "withTrace: a sink that was still blocked " ++ show limit
        ++ " s after the end of the trace is left behind; events lost: " ++ show n

instance Exception SinkProblem

-- | Passes it to GHC's handler for uncaught exceptions. (What that throws has no effect.)
notify :: SinkProblem -> IO ()
notify problem = void (try (getUncaughtExceptionHandler >>= ($ toException problem)) :: IO (Either SomeException ()))

-- | 'notify' in a thread of its own, awaited for at most a tenth of a second: GHC's handler flushes
-- 'System.IO.stdout', and so it blocks while a sink that prints is blocked.
notifySoon :: SinkProblem -> IO ()
notifySoon problem = do
  notified <- newIORef False
  _ <- forkIO (notify problem >> writeIORef notified True)
  deadline <- (+ 0.1) <$> getMonotonicTime
  void (awaitUntil deadline notified)
