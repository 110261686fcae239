{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- What all specs share: a watchdog, gates, a notebook, a caller who can be
-- cancelled, and a way to say how an action ended.
--
-- Nothing here sleeps. What has to happen in a certain order is made to, by gates;
-- and where only the state of a thread tells ('awaitIdle', 'awaitOver'), that is
-- asked for again and again, until the watchdog barks.
module Support
  ( -- * Around every example
    guarded
  , within
  , leavingNothing

    -- * Gates
  , Gate
  , newGate
  , open
  , openAll
  , pass
  , passed
  , untilOpen
  , hang

    -- * The notebook
  , Log
  , newLog
  , note
  , notes

    -- * A caller who can be cancelled
  , launching
  , cancelling
  , throwing
  , awaitThrown
  , readMessages
  , awaitEnd
  , stillRunning
  , awaitIdle
  , awaitOver
  , eventually

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
import Data.Maybe (isNothing)
import GHC.Conc (BlockReason (..), ThreadStatus (..), threadStatus)
import System.Mem.Weak (deRefWeak)
import System.Timeout (timeout)
import Test.Hspec (Spec, around_, expectationFailure)
import Test.QuickCheck (Arbitrary (..), Property, elements, frequency, ioProperty, (===))

import Behavior
  ( StoppedWithFault (..)
  , behaviorFailedFromException
  , behaviorFailedToException
  )
import Behavior.Internal.Failure (isCancellation, isFailure)
import Behavior.Internal.Runtime (atomically, liveThreadCount)

-- | Every spec as a whole goes in here: each example must be over within twenty
-- seconds (of which it needs one at the most, unless the machine is very busy), and
-- must leave no thread of the library running.
guarded :: Spec -> Spec
guarded = around_ (within 20 . leavingNothing)

-- | Fails when the action takes more than so many (real) seconds, also when it
-- cannot be interrupted: then its thread is left behind.
within :: Int -> IO a -> IO a
within seconds act = do
  box <- newEmptyMVar
  thread <- mask_ (forkIOWithUnmask (\unmask -> try (unmask act) >>= putMVar box))
  -- A strong reference would hide from GHC that everything is deadlocked.
  weakly <- mkWeakThreadId thread
  let abandon = deRefWeak weakly >>= traverse_ (forkIO . killThread)
  over <- timeout (seconds * 1000000) (takeMVar box) `onException` abandon
  case over of
    Just (Right a) -> pure a
    Just (Left (e :: SomeException)) -> throwIO e
    Nothing -> do
      abandon
      expectationFailure ("the watchdog: this was not over after " ++ show seconds ++ " s")
      throwIO (ErrorCall "unreachable")

-- | Checks that as many threads of the library live after the action, at the very
-- moment when it returns or throws, as lived before it.
leavingNothing :: IO a -> IO a
leavingNothing act = mask $ \restore -> do
  before <- liveThreadCount
  end <- try (restore act)
  after <- liveThreadCount
  unless (after == before) . expectationFailure $
    show (after - before) ++ " threads were left running"
  either (\(e :: SomeException) -> throwIO e) pure end

-- | What one waits at until somebody opens it, for ever.
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

-- | Does it again and again until the gate is open.
untilOpen :: Gate -> IO () -> IO ()
untilOpen gate@(Gate state) act =
  readTVarIO state >>= \isOpen -> unless isOpen (act >> untilOpen gate act)

-- | Waits until it is interrupted.
hang :: IO a
hang = atomically retry

-- | Who did what, in the order in which it happened.
newtype Log e = Log (TVar [e])

newLog :: IO (Log e)
newLog = Log <$> newTVarIO []

-- | Notes; it is never blocked, so it cannot be interrupted where exceptions are
-- masked.
note :: Log e -> e -> IO ()
note (Log events) e = atomically (modifyTVar' events (e :))

notes :: Log e -> IO [e]
notes (Log events) = reverse <$> readTVarIO events

-- | Runs an action in a thread of its own while the second one looks at it and
-- tampers with it; when that ends, the action is ended too.
launching :: IO a -> (Async a -> IO b) -> IO b
launching = withAsync

-- | Starts the caller, does what is to be done first, then cancels the caller, and
-- says how that one ended.
cancelling :: IO a -> IO () -> IO (Ending a)
cancelling act first = launching act $ \caller -> do
  first
  throwTo (asyncThreadId caller) (Cancel "the caller")
  awaitEnd caller

-- | Throws an exception to the thread, from a thread of its own, and returns once
-- the exception was delivered or is waiting to be.
throwing :: Exception e => ThreadId -> e -> IO ()
throwing target e = do
  forkIO (throwTo target e) >>= awaitThrown

-- | Returns once what the thread throws, and then ends, was received or is pending.
awaitThrown :: ThreadId -> IO ()
awaitThrown thrower = do
  eventually $ (`elem` [ThreadBlocked BlockedOnException, ThreadFinished]) <$> threadStatus thrower
  -- It may be under way yet, to another capability (and to one more, if the thread was
  -- moved meanwhile).
  replicateM_ 2 readMessages

-- | Returns once each capability has read what was sent to it before: it does so before it
-- runs a thread that is sent later.
readMessages :: IO ()
readMessages = do
  capabilities <- getNumCapabilities
  for_ [1 .. capabilities] $ \c -> forkOn c (pure ()) >>= awaitOver

awaitEnd :: Async a -> IO (Ending a)
awaitEnd caller = endingOf <$> waitCatch caller

-- | Fails when the action has ended. It looks when the thread is over or waits, so
-- that one which is about to end does not pass for one that goes on.
stillRunning :: Async a -> IO ()
stillRunning caller = do
  awaitIdle (asyncThreadId caller)
  over <- poll caller
  unless (isNothing over) $ expectationFailure "it has ended already"

-- | Returns once the thread waits (in a transaction, at an 'MVar', or for the time),
-- or is over.
awaitIdle :: ThreadId -> IO ()
awaitIdle thread = eventually $ (`elem` idle) <$> threadStatus thread
 where
  idle = map ThreadBlocked [BlockedOnSTM, BlockedOnMVar, BlockedOnOther] ++ [ThreadFinished, ThreadDied]

-- | Returns once the thread is over, so that whoever looks sees how it ended.
awaitOver :: ThreadId -> IO ()
awaitOver thread = eventually $ (`elem` [ThreadFinished, ThreadDied]) <$> threadStatus thread

-- | Asks again and again, and lets the others run meanwhile.
eventually :: IO Bool -> IO ()
eventually question = question >>= \yes -> unless yes (yield >> eventually question)

-- | How an action ended. Exceptions are told apart by their class and their text.
data Ending a
  = Gave a
  | FailedWith String
  | FaultedWith String
  | CancelledBy String
  | -- | Cancelled by the first, and the second is the fault met on the way.
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
  | isFailure e = FailedWith (show e)
  | otherwise = FaultedWith (show e)

-- | Somebody's bug.
newtype Fault = Fault String
  deriving (Eq, Show)

instance Exception Fault

-- | A failure of somebody's own type.
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

-- | Runs the action, and when it is interrupted the cleanup, which nothing can
-- interrupt, not even where it waits.
uninterruptibly :: IO a -> IO () -> IO a
uninterruptibly act cleanup = act `onException` uninterruptibleMask_ cleanup

-- | A behaviour that notes its name, then ends.
data Script = Script String End
  deriving (Eq, Show)

data End
  = Succeeds Int
  | Fails String
  | Faults String
  | -- | Throws a cancellation (as somebody's code may who caught one).
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
play notebook (Script name end) = do
  note notebook name
  case end of
    Succeeds n -> pure n
    Fails why -> throwIO (Failure why)
    Faults why -> throwIO (Fault why)
    Cancels why -> throwIO (Cancel why)

-- | Both behaviours end alike and do the same in the same order.
sameAs :: (Eq a, Show a) => (Log String -> IO a) -> (Log String -> IO a) -> Property
sameAs one other = ioProperty ((===) <$> observing one <*> observing other)

-- | How an action ended, and what it noted.
observing :: (Log e -> IO a) -> IO (Ending a, [e])
observing act = do
  notebook <- newLog
  (,) <$> ending (act notebook) <*> notes notebook
