{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- What all specs share: a watchdog, gates, a log, a caller that can be cancelled, and
-- a type for how an action ended.
--
-- Nothing here sleeps. Where the order of events matters, gates force it. Where only
-- the state of a thread shows it ('awaitIdle', 'awaitOver'), that state is read
-- repeatedly, until the watchdog fails the example.
module Support
  ( -- * Around every example
    guarded
  , within
  , leavingNothing
  , onOneCapability
  , everywhere
  , sampleSize
  , sampling

    -- * Gates
  , Gate
  , newGate
  , open
  , openAll
  , pass
  , passed
  , hang

    -- * The log
  , Log
  , newLog
  , note
  , notes

    -- * A caller that can be cancelled
  , withThread
  , cancelling
  , throwing
  , awaitThrown
  , readMessages
  , awaitEnd
  , stillRunning
  , awaitIdle
  , awaitOver
  , eventually
  , collecting
  , collectingUntil

    -- * The threads that the library starts
  , ThreadEvent (..)
  , watchingThreads

    -- * How an action ends
  , Ending (..)
  , ending
  , endingOf
  , Fault (..)
  , Failure (..)
  , Cancel (..)
  , uninterruptibly

    -- * Behaviours to try laws on
  , Script (..)
  , End (..)
  , play
  , sameAs
  , observing
  ) where

import Control.Concurrent
import Control.Concurrent.Async (Async, asyncThreadId, poll, waitCatch, withAsync)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (replicateM_, unless)
import Data.Foldable (for_, traverse_)
import Data.Maybe (isJust, isNothing)
import GHC.Conc (BlockReason (..), ThreadStatus (..), threadStatus)
import System.Environment (lookupEnv)
import System.Mem (performMajorGC)
import System.Mem.Weak (deRefWeak)
import System.Timeout (timeout)
import Test.Hspec (Spec, around_, expectationFailure, runIO)
import Test.Hspec.QuickCheck (modifyMaxSuccess)
import Test.QuickCheck (Arbitrary (..), Property, elements, frequency, ioProperty, (===))

import Behavior
  ( StoppedWithFault (..)
  , behaviorFailedFromException
  , behaviorFailedToException
  )
import Behavior.Internal.Core.Failure (BehaviorFailed (..), isCancellation)
import Behavior.Internal.Seam.Runtime (Label (..), atomically, liveThreadCount)
import Behavior.Internal.Spans.Place
import Behavior.Trace (adopt)
import qualified Behavior.Trace as Trace

-- | Wraps every spec: each example must end within twenty seconds (it needs at most
-- one, unless the machine is very busy), and must leave no thread of the library
-- running.
guarded :: Spec -> Spec
guarded = around_ (within 20 . leavingNothing)

-- | Fails when the action takes more than the given number of (real) seconds, also
-- when it cannot be interrupted: then its thread is left running.
within :: Int -> IO a -> IO a
within seconds act = do
  box <- newEmptyMVar
  thread <- mask_ (forkIOWithUnmask (\unmask -> try (unmask act) >>= putMVar box))
  -- With a strong reference GHC could not detect a deadlock of all threads.
  weakThread <- mkWeakThreadId thread
  let abandon = deRefWeak weakThread >>= traverse_ (forkIO . killThread)
  over <- timeout (seconds * 1000000) (takeMVar box) `onException` abandon
  case over of
    Just (Right a) -> pure a
    Just (Left (e :: SomeException)) -> throwIO e
    Nothing -> do
      abandon
      expectationFailure ("the watchdog: this was not over after " ++ show seconds ++ " s")
      throwIO (ErrorCall "unreachable")

-- | Checks that as many threads of the library are alive at the moment when the action
-- returns or throws as were alive before it.
leavingNothing :: IO a -> IO a
leavingNothing act = mask $ \restore -> do
  before <- liveThreadCount
  end <- try (restore act)
  after <- liveThreadCount
  unless (after == before) . expectationFailure $
    show (after - before) ++ " threads were left running"
  either (\(e :: SomeException) -> throwIO e) pure end

-- | Runs the action on one of GHC's capabilities.
onOneCapability :: IO a -> IO a
onOneCapability = bracket (getNumCapabilities <* setNumCapabilities 1) setNumCapabilities . const

-- | Whether all is tried: the variable @EVERYWHERE@ is set, as in CI.
everywhere :: IO Bool
everywhere = isJust <$> lookupEnv "EVERYWHERE"

-- | That many random inputs 'everywhere', and a sixth of them otherwise.
sampleSize :: Int -> IO Int
sampleSize number = everywhere >>= \isAll -> pure (if isAll then number else number `div` 6)

-- | Tries that many random inputs, or a sixth of them ('sampleSize'). With @--qc-max-success@, that many of what is
-- cheapest: the number here is the share of it, in 3,000.
sampling :: Int -> Spec -> Spec
sampling share tests = do
  least <- runIO (sampleSize share)
  modifyMaxSuccess (\asked -> max least (asked * share `div` 3000)) tests

-- | Blocks the threads that pass it until it is opened; it is never closed again.
newtype Gate = Gate (TVar Bool)

newGate :: IO Gate
newGate = Gate <$> newTVarIO False

open :: Gate -> IO ()
open gate = openAll [gate]

-- | Opens several gates in one transaction.
openAll :: [Gate] -> IO ()
openAll gates = atomically (for_ gates (\(Gate state) -> writeTVar state True))

-- | Waits until the gate is open.
pass :: Gate -> IO ()
pass = atomically . passed

passed :: Gate -> STM ()
passed (Gate state) = readTVar state >>= check

-- | Blocks until it is interrupted.
hang :: IO a
hang = atomically retry

-- | The entries that the threads of an example add, in their order.
newtype Log e = Log (TVar [e])

newLog :: IO (Log e)
newLog = Log <$> newTVarIO []

-- | Adds an entry. It never blocks, so it cannot be interrupted where exceptions are
-- masked.
note :: Log e -> e -> IO ()
note (Log events) e = atomically (modifyTVar' events (e :))

notes :: Log e -> IO [e]
notes (Log events) = reverse <$> readTVarIO events

-- | Runs the action in a thread of its own while the second action observes and
-- interrupts it; when the second action ends, the first is cancelled.
withThread :: IO a -> (Async a -> IO b) -> IO b
withThread act body = adopt >>= \here -> withAsync (here act) body

-- | A thread that the library starts begins or ends.
data ThreadEvent = Started Label | Ended Label
  deriving (Eq, Show)

-- | Passes what the threads do that are started within the action to the function: each thread calls it
-- itself, masked.
watchingThreads :: (ThreadEvent -> IO ()) -> IO a -> IO a
watchingThreads f act = do
  here <- myPlace
  let receiver = Receiver {firstNumber = 1, needsDetail = True, receiveEvent = traverse_ f . threadEvent}
  whole <- withReceiver receiver <$> maybe (newTrace (pure 0)) (pure . trace) here
  let inside = maybe (placeIn [] whole) (\place -> place {trace = whole}) here
  mask $ \restore -> withLiveTrace whole (inPlace (Just inside) (restore act))
 where
  threadEvent = \case
    Trace.Began s | isThread s -> Just (Started (labelOf s))
    Trace.Ended s _ _ | isThread s -> Just (Ended (labelOf s))
    _ -> Nothing
  isThread s = Trace.spanKind s == Trace.Branch
  labelOf s = let (op, rest) = break (== ':') (Trace.spanName s) in Label op (drop 2 rest)

-- | Runs the first action as a caller, in a thread of its own; runs the second action;
-- then cancels the caller and returns how it ended.
cancelling :: IO a -> IO () -> IO (Ending a)
cancelling act first = withThread act $ \caller -> do
  first
  throwTo (asyncThreadId caller) (Cancel "the caller")
  awaitEnd caller

-- | Throws an exception to the thread, from a thread of its own, and returns once
-- the exception was received or is pending.
throwing :: Exception e => ThreadId -> e -> IO ()
throwing target e = do
  forkIO (throwTo target e) >>= awaitThrown

-- | Returns once the exception that this thread throws was received or is pending. (The
-- thread ends when it has thrown it.)
awaitThrown :: ThreadId -> IO ()
awaitThrown thrower = do
  eventually $ (`elem` [ThreadBlocked BlockedOnException, ThreadFinished]) <$> threadStatus thrower
  -- The exception may still be on its way to another capability (and then to a further
  -- one, if the thread was moved meanwhile).
  replicateM_ 2 readMessages

-- | Returns once each capability has handled the messages that were sent to it before: it
-- does so before it runs a thread that is sent later.
readMessages :: IO ()
readMessages = do
  capabilities <- getNumCapabilities
  for_ [1 .. capabilities] $ \c -> forkOn c (pure ()) >>= awaitOver

awaitEnd :: Async a -> IO (Ending a)
awaitEnd caller = endingOf <$> waitCatch caller

-- | Fails when the action has ended. It checks this once the thread has ended or is
-- blocked, so that a thread which is about to end does not count as running.
stillRunning :: Async a -> IO ()
stillRunning caller = do
  awaitIdle (asyncThreadId caller)
  over <- poll caller
  unless (isNothing over) $ expectationFailure "it has ended already"

-- | Returns once the thread is blocked (in a transaction, at an 'MVar', or in a delay),
-- or has ended.
awaitIdle :: ThreadId -> IO ()
awaitIdle thread = eventually $ (`elem` idle) <$> threadStatus thread
 where
  idle = map ThreadBlocked [BlockedOnSTM, BlockedOnMVar, BlockedOnOther] ++ [ThreadFinished, ThreadDied]

-- | Returns once the thread has ended, so that its outcome is visible to other threads.
awaitOver :: ThreadId -> IO ()
awaitOver thread = eventually $ (`elem` [ThreadFinished, ThreadDied]) <$> threadStatus thread

-- | Repeats the check until it gives 'True', and yields in between: to other threads, and the processor, for which
-- another capability may wait.
eventually :: IO Bool -> IO ()
eventually holds = holds >>= \isTrue -> unless isTrue (yield >> yieldProcessor >> eventually holds)

foreign import ccall unsafe "sched_yield" yieldProcessor :: IO ()

-- | Collects garbage, whereupon GHC finds deadlocks; then it pauses: what collects again and again would leave no time
-- to the threads of other capabilities.
collecting :: IO ()
collecting = performMajorGC >> threadDelay 500

-- | Collects garbage until the gate is open.
collectingUntil :: Gate -> IO ()
collectingUntil (Gate state) = eventually (collecting >> readTVarIO state)

-- | How an action ended. Exceptions are compared by their class and their text.
data Ending a
  = Gave a
  | FailedWith String
  | FaultedWith String
  | CancelledBy String
  | -- | Cancelled by the first exception; the second is the fault thrown while stopping.
    CancelledWithFault String String
  deriving (Eq, Ord, Show)

ending :: IO a -> IO (Ending a)
ending = fmap endingOf . try

endingOf :: Either SomeException a -> Ending a
endingOf (Right a) = Gave a
endingOf (Left e)
  | Just (StoppedWithFault cause fault) <- fromException e =
      CancelledWithFault (show cause) (show fault)
  | isCancellation e = CancelledBy (show e)
  -- (Without its path: an operator that adds to that, gives the same failure.)
  | Just (BehaviorFailed _ failure) <- fromException e = FailedWith (show failure)
  | otherwise = FaultedWith (show e)

-- | A bug in users' code.
newtype Fault = Fault String
  deriving (Eq, Show)

instance Exception Fault

-- | A failure of a user's own type.
newtype Failure = Failure String
  deriving (Eq, Show)

instance Exception Failure where
  toException = behaviorFailedToException
  fromException = behaviorFailedFromException

-- | A cancellation that is not this library's.
newtype Cancel = Cancel String
  deriving (Eq, Show)

instance Exception Cancel where
  toException = asyncExceptionToException
  fromException = asyncExceptionFromException

-- | Runs the action and, when it is interrupted, the cleanup. Nothing can interrupt the
-- cleanup, not even where it blocks.
uninterruptibly :: IO a -> IO () -> IO a
uninterruptibly act cleanup = act `onException` uninterruptibleMask_ cleanup

-- | A behaviour that adds its name to the log, then ends as given.
data Script = Script String End
  deriving (Eq, Show)

data End
  = Succeeds Int
  | Fails String
  | Faults String
  | -- | Throws a cancellation (as users' code may after it has caught one).
    Cancels String
  deriving (Eq, Show)

instance Arbitrary Script where
  arbitrary = Script <$> elements (map pure ['a' .. 'z']) <*> arbitrary
  shrink (Script name end) = Script name <$> shrink end

instance Arbitrary End where
  arbitrary =
    frequency
      [ (3, Succeeds <$> arbitrary)
      , (7, Fails <$> elements ["locked", "lost", "empty"])
      , (1, Faults <$> elements ["bug", "no device"])
      , (1, Cancels <$> elements ["user", "caller"])
      ]
  shrink (Succeeds n) = Succeeds <$> shrink n
  shrink _ = [Succeeds 0]

play :: Log String -> Script -> IO Int
play entries (Script name end) = do
  note entries name
  case end of
    Succeeds n -> pure n
    Fails why -> throwIO (Failure why)
    Faults why -> throwIO (Fault why)
    Cancels why -> throwIO (Cancel why)

-- | Both behaviours have equal endings and add the same entries in the same order.
sameAs :: (Eq a, Show a) => (Log String -> IO a) -> (Log String -> IO a) -> Property
sameAs one other = ioProperty ((===) <$> observing one <*> observing other)

-- | How an action ended, and the entries that it added to the log.
observing :: (Log e -> IO a) -> IO (Ending a, [e])
observing act = do
  entries <- newLog
  (,) <$> ending (act entries) <*> notes entries
