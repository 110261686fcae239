{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE CPP #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- The part of the seam that starts threads and throws to them.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Seam.Thread
  ( -- * Starting
    Label (..)
  , Thread
  , threadId
  , threadEnd
  , tryReadEndSTM
  , tryReadEnd
  , start
  , startWith
  , Placement (..)
  , liveThreadCount

    -- * Throwing
  , interrupt
  , throwToOne
  , throwToAll
  ) where

import Control.Concurrent (ThreadId, forkIO, myThreadId, throwTo, yield)
import Control.Concurrent.STM (STM, TVar)
import qualified Control.Concurrent.STM as STM
import Control.Exception
  ( Exception (toException)
  , SomeException
  , catch
  , onException
  , uninterruptibleMask_
  )
import Control.Monad (when)
import Data.Foldable (for_)
import Data.IORef (newIORef, readIORef)
import GHC.Conc (labelThread)
import GHC.IORef (atomicModifyIORef'_)

#if !MIN_VERSION_base(4,18,0)
import GHC.RTS.Flags (DoTrace (..), TraceFlags (tracing), getTraceFlags)
import System.IO.Unsafe (unsafePerformIO)
#endif

import Behavior.Internal.Core.Backend
import Behavior.Internal.Core.Counter
import Behavior.Internal.Core.Dispatch
import Behavior.Internal.Seam.Fork
import Behavior.Internal.Spans.Place (Place (path), inPath, myPlace)
import Behavior.Internal.Spans.Span (branchSpan)

-- | A thread that the library has started, and what it publishes as it ends.
--
-- (It is not an @Async r@: reading the result of one without blocking takes a transaction, the transaction that
-- publishes its result can write nothing else, and a branch would take more bytes.)
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

-- | Labels the calling thread. (If the text of a name throws, of whatever type, that must not end the thread; and
-- a stop request must not be taken for it.)
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
