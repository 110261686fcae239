{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE ExistentialQuantification #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Structured concurrency, once for all operators.
--
-- An operator starts branches in a 'Scope' and comes to a verdict. Then, however
-- it came to that, 'structured' keeps the promises that are the same everywhere:
--
-- 1. What was started has ended, cleanup included, before the operator returns or
--    throws; nothing orphans it, not even a second cancellation.
-- 2. What has to stop is asked all at once, then waited for.
-- 3. The outcome is the first that there is of: what was thrown at the caller from
--    outside, the leftmost fault, the operator's verdict.
--
-- Users' code runs in branches, or where an operator catches what it throws. So an exception
-- that reaches 'structured' was thrown at the caller from outside, whatever its type.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Scope
  ( -- * Scopes
    Scope
  , structured

    -- * Branches
  , Branch
  , outcome
  , tryReadOutcomeSTM
  , tryReadOutcome
  , awaitOutcome
  , SomeBranch (..)
  , branch
  , branchWithHook
  , worker
  , forget
  , requestStopAsync
  , requestStop

    -- * How a branch ends
  , Outcome (..)
  , completedNow
  , outcomeToIO
  , result
  ) where

import Control.Concurrent (ThreadId, myThreadId)
import Control.Concurrent.STM (STM)
import Control.Exception
  ( BlockedIndefinitelyOnMVar (..)
  , BlockedIndefinitelyOnSTM (..)
  , Exception (..)
  , MaskingState (..)
  , SomeAsyncException (..)
  , SomeException (..)
  , asyncExceptionFromException
  , asyncExceptionToException
  , catch
  , evaluate
  , getMaskingState
  , mask
  , mask_
  , throwIO
  , try
  )
import Control.Monad (foldM, when)
import Data.IORef (IORef, modifyIORef', newIORef, readIORef, writeIORef)
import Data.Maybe (isJust)

import Behavior.Internal.Failure (BehaviorFailed (..), StoppedWithFault (..), isFailure)
import Behavior.Internal.Runtime

-- | The branches that an operator has started, newest first. Only the operator's
-- own thread starts, stops and forgets them.
newtype Scope = Scope (IORef [SomeBranch])

-- | A behaviour that runs in a thread of its own on behalf of an operator.
data Branch a = Branch
  { branchThread :: {-# UNPACK #-} !(Thread (Outcome a))
  , stopRequested :: {-# UNPACK #-} !(IORef Bool)
  -- ^ Whether it was asked to stop: nobody is asked twice, for the second
  -- request would interrupt the cleanup that the first one began.
  }

-- | How the branch ended; retries until it has.
outcome :: Branch a -> STM (Outcome a)
outcome = threadEnd . branchThread

-- | How the branch ended, if it has. (To ask several branches so, one after the other, is
-- the same as 'orElse' between their outcomes, without its nested transactions.)
tryReadOutcomeSTM :: Branch a -> STM (Maybe (Outcome a))
tryReadOutcomeSTM = tryReadEndSTM . branchThread

branchId :: Branch a -> ThreadId
branchId = threadId . branchThread

-- | A branch, whatever it returns.
data SomeBranch = forall a. SomeBranch (Branch a)

-- | How a branch ended.
data Outcome a
  = -- | It returned, though perhaps it had been asked to stop.
    Completed a
  | -- | It failed.
    Failing SomeException
  | -- | It threw anything else, perhaps while it was being stopped.
    Faulted SomeException
  | -- | It was asked to stop and did.
    Stopped SomeException

-- | Lets the body start branches and come to a verdict (an action that returns or
-- throws), stops what still runs, and gives the outcome.
structured :: (Scope -> IO (IO a)) -> IO a
structured body = do
  state <- getMaskingState
  mask $ \restore -> do
    scope <- Scope <$> newIORef []
    -- (As @body scope@ it would be a thunk first, in every operator.)
    verdict <- try (restore (pure scope >>= body))
    (thrown, faults) <- stopAll scope state (either Just (const Nothing) verdict)
    deadlocked <- maybe (pure False) isDeadlock thrown
    case (thrown, faults) of
      (Just e, []) | not deadlocked -> throwIO e
      (Just e, fault : _) | not deadlocked -> withFault e fault
      -- What was thrown at the caller while it could not be interrupted arrives here, and
      -- not when the outcome has been thrown into some handler of the caller's.
      (_, []) -> restore checkpoint >> either throwIO id verdict
      (_, fault : _) -> do
        restore checkpoint `catch` \e -> withFault e fault
        throwIO fault
 where
  withFault e fault = defined e >>= \e' -> throwIO (StoppedWithFault e' fault)

-- | Whether GHC threw it because the thread waits for what will never come. It throws that to
-- a branch and to the operator that waits for it alike, so a fault of the branch comes first.
isDeadlock :: SomeException -> IO Bool
isDeadlock thrown = defined thrown >>= \e -> pure $ case (fromException e, fromException e) of
  (Just BlockedIndefinitelyOnSTM, _) -> True
  (_, Just BlockedIndefinitelyOnMVar) -> True
  _ -> False

-- | Stops everything in the scope. Gives what has been thrown at the caller (before, or while
-- this waits), and the faults from left to right.
--
-- A caller that is not masked can be interrupted here until something was thrown at it: so a
-- cleanup may throw to it. After that it cannot, or branches would be orphaned; what is
-- thrown then stays pending, in GHC's own queue, from which it can be withdrawn. (To receive
-- it here and throw it again later would let a time limit reach what comes after its end.)
-- Neither can a caller that is masked: it must not lose the verdict.
stopAll :: Scope -> MaskingState -> Maybe SomeException -> IO (Maybe SomeException, [SomeException])
stopAll (Scope branches) state before = do
  newestFirst <- readIORef branches
  (thrown, ()) <- interruptibleOnce before (requestStop newestFirst)
  fmap reverse <$> foldM withFault (thrown, []) (reverse newestFirst)
 where
  withFault (thrown, faults) (SomeBranch b) = do
    (thrown', o) <- tryReadThenBlock (fmap ((,) thrown) <$> tryReadOutcome b) (interruptibleOnce thrown (atomically (outcome b)))
    pure $! case o of
      Faulted e -> (thrown', e : faults)
      _ -> (thrown', faults)
  -- Waits so that it can be interrupted; then so that it cannot.
  interruptibleOnce thrown wait = case thrown of
    Nothing | state == Unmasked -> do
      waited <- try wait
      case waited of
        Right a -> pure (Nothing, a)
        Left e -> do
          deadlocked <- isDeadlock e
          (,) (if deadlocked then Nothing else Just e) <$> awaitUninterruptibly wait
    _ -> (,) thrown <$> awaitUninterruptibly wait

-- | Starts a branch.
branch :: Scope -> Label -> IO a -> IO (Branch a)
branch = branchWithHook (\_ -> pure ())

-- | The same; in the transaction that publishes how the branch ended, the given is done too.
branchWithHook :: (Outcome a -> STM ()) -> Scope -> Label -> IO a -> IO (Branch a)
branchWithHook hook scope label act = launch scope (\_ -> startWith classify hook label act)

-- | Starts a branch that can see whether it was asked to stop. One that runs a
-- user's action in a loop must look: the action may have swallowed the request.
worker :: Scope -> Label -> (IO Bool -> IO a) -> IO (Branch a)
worker scope label act = launch scope (startWith classify (\_ -> pure ()) label . act)

launch :: Scope -> (IO Bool -> IO (Thread (Outcome a))) -> IO (Branch a)
launch (Scope branches) startThread = mask_ $ do
  requested <- newIORef False
  thread <- startThread (readIORef requested)
  let new = Branch {branchThread = thread, stopRequested = requested}
  modifyIORef' branches (SomeBranch new :)
  pure new

-- | Takes a branch that has ended, and did not fault, out of the scope, which
-- otherwise would grow with every branch that an operator ever started.
forget :: Scope -> Branch a -> IO ()
forget (Scope branches) old = modifyIORef' branches without
 where
  -- Strict: an unevaluated list would hold on to what was taken out of it.
  without [] = []
  without (SomeBranch b : others)
    | branchId b == branchId old = others
    | otherwise = let rest = without others in rest `seq` (SomeBranch b : rest)

-- | Asks branches to stop, all at once, by threads of its own: none receives it later because
-- another cannot be interrupted just now. It does not wait until they have; so nothing that
-- interrupts the caller withdraws what it has asked for.
requestStopAsync :: [SomeBranch] -> IO ()
requestStopAsync branches = mask_ $ claimStopRequests branches >>= throwToAll Stop

-- | The same for a caller that then waits for the end of them all, and can wait here, too: it
-- asks a single branch itself, which costs less.
requestStop :: [SomeBranch] -> IO ()
requestStop branches = mask_ $
  claimStopRequests branches >>= \case
    [thread] -> throwToOne thread (Stop thread)
    threads -> throwToAll Stop threads

-- | Those that are still to be asked, which from now on count as asked.
claimStopRequests :: [SomeBranch] -> IO [ThreadId]
claimStopRequests = foldM requested []
 where
  requested threads (SomeBranch b) = do
    needed <- claimStopRequest b
    pure $! if needed then branchId b : threads else threads

-- | Marks a branch as asked. False if it was asked before, or has ended.
claimStopRequest :: Branch a -> IO Bool
claimStopRequest b = do
  over <- isJust <$> tryReadEnd (branchThread b)
  requested <- readIORef (stopRequested b)
  let needed = not (over || requested)
  when needed $ writeIORef (stopRequested b) True
  pure needed

-- | Waits for the end of the branch.
awaitOutcome :: Branch a -> IO (Outcome a)
awaitOutcome b = tryReadThenBlock (tryReadOutcome b) (atomically (outcome b))

-- | How the branch has ended, if it has, at a glance.
tryReadOutcome :: Branch a -> IO (Maybe (Outcome a))
tryReadOutcome = tryReadEnd . branchThread

-- | What the branch has returned, if it has.
completedNow :: Branch a -> IO (Maybe a)
completedNow b = (>>= either (const Nothing) Just . result) <$> tryReadOutcome b

-- | The action that an outcome stands for.
outcomeToIO :: Outcome a -> IO a
outcomeToIO = either throwIO pure . result

-- | What a branch returned, or what it threw.
result :: Outcome a -> Either SomeException a
result = \case
  Completed a -> Right a
  Failing e -> Left e
  Faulted e -> Left e
  Stopped e -> Left e

-- | How a branch ended whose action ended so. It is called in the branch's own thread: an
-- exception may itself be undefined, and to look at it throws, which must happen to no
-- operator that still has branches. What that throws is the fault.
classify :: Either SomeException a -> IO (Outcome a)
classify = \case
  Right a -> pure (Completed a)
  Left e -> do
    self <- myThreadId
    try (evaluate (kind self e)) >>= either (fmap Faulted . defined) pure
 where
  kind self e
    | isStopOf self e = Stopped e
    | otherwise = kindOfOther self (forced e)
  kindOfOther self e
    | Just (StoppedWithFault cause fault) <- fromException e, isStopOf self cause = Faulted $! forced fault
    | isFailure e = Failing e
    | otherwise = Faulted e
  isStopOf self cause = fromException cause == Just (Stop self)

-- | The exception; or if it is itself undefined, what it throws.
defined :: SomeException -> IO SomeException
defined e = try (evaluate (forced e)) >>= either defined pure

-- | The exception; all that handlers match on is evaluated with it.
forced :: SomeException -> SomeException
forced e@(SomeException inner)
  | Just (BehaviorFailed failure) <- fromException e = failure `seq` e
  | Just (SomeAsyncException cancellation) <- fromException e = cancellation `seq` e
  | otherwise = inner `seq` e

-- | How an operator asks a branch to stop. It names the thread it is meant for: a
-- request that strays into another thread is not mistaken for that one's own.
newtype Stop = Stop ThreadId
  deriving (Eq)

instance Show Stop where
  show (Stop _) = "Stop: the operator that started this behaviour no longer wants it"

instance Exception Stop where
  toException = asyncExceptionToException
  fromException = asyncExceptionFromException
