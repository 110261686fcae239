{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE ExistentialQuantification #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Structured concurrency, implemented once for all operators.
--
-- An operator starts branches in a 'Scope' and reaches a verdict. Then, whatever the
-- verdict is, 'structured' keeps the promises that are the same for every operator:
--
-- 1. Everything that was started has ended, cleanup included, before the operator returns or
--    throws; no branch is orphaned, not even by a second cancellation.
-- 2. The stop of everything that has to stop is requested first; then the operator waits.
-- 3. The outcome is the first that exists of: what was thrown at the caller from outside,
--    the leftmost fault, the operator's verdict.
--
-- Users' code runs in branches, or where an operator catches what it throws. So an exception
-- that reaches 'structured' was thrown at the caller from outside, whatever its type.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Concurrent.Scope
  ( -- * Scopes
    Scope
  , Verdict (..)
  , structured

    -- * Branches
  , Branch
  , outcome
  , tryReadOutcomeSTM
  , tryReadOutcome
  , awaitOutcome
  , SomeBranch (..)
  , branch
  , Starting (..)
  , plainly
  , branchWith
  , forget
  , forgetEnded
  , requestStopAsync
  , requestStop

    -- * How a branch ends
  , completedNow
  , endedBy
  ) where

import Control.Concurrent (ThreadId)
import Control.Concurrent.STM (STM)
import Control.Exception
  ( BlockedIndefinitelyOnMVar (..)
  , BlockedIndefinitelyOnSTM (..)
  , Exception (..)
  , MaskingState (..)
  , SomeException
  , catch
  , getMaskingState
  , mask
  , mask_
  , throwIO
  , try
  )
import Control.Monad (foldM, when)
import Data.IORef (IORef, modifyIORef', newIORef, readIORef, writeIORef)
import Data.Maybe (isJust)

import Behavior.Internal.Concurrent.Outcome (Outcome (..), classify, defined, outcomeToIO, result)
import Behavior.Internal.Core.Cause (Cause (..))
import Behavior.Internal.Core.Failure (StoppedWithFault (..))
import Behavior.Internal.Core.Stop (Stop (..), causeOf)
import Behavior.Internal.Seam.Runtime
import Behavior.Internal.Spans.Span (operatorSpan)

-- | What an operator has started.
data Scope = Scope
  { operator :: String
  -- ^ Its name, for labels, spans and causes.
  , branches :: {-# UNPACK #-} !(IORef [SomeBranch])
  -- ^ The newest first. Only the operator's own thread starts, stops and forgets them.
  }

-- | A behaviour that an operator runs in a separate thread.
data Branch a = Branch
  { branchThread :: {-# UNPACK #-} !(Thread (Outcome a))
  , stopRequested :: {-# UNPACK #-} !(IORef Bool)
  -- ^ Whether its stop was requested. That happens only once: a second request would interrupt
  -- the cleanup that the first one began.
  }

-- | How the branch ended; retries until it has ended.
outcome :: Branch a -> STM (Outcome a)
outcome = threadEnd . branchThread

-- | How the branch ended, if it has. (To read several branches with it, one after the other,
-- is equivalent to 'orElse' between their outcomes, without its nested transactions.)
tryReadOutcomeSTM :: Branch a -> STM (Maybe (Outcome a))
tryReadOutcomeSTM = tryReadEndSTM . branchThread

branchId :: Branch a -> ThreadId
branchId = threadId . branchThread

-- | A branch, whatever it returns.
data SomeBranch = forall a. SomeBranch (Branch a)

-- | What an operator has decided: an action that returns or throws; and why the branches that still
-- run are stopped.
data Verdict a = Verdict Cause (IO a)

-- | The verdict of an operator that ends as the branch with this name did.
endedBy :: String -> Outcome a -> Verdict a
endedBy name end = Verdict cause (outcomeToIO end)
 where
  cause = case end of
    Completed _ -> SiblingFinished name
    _ -> SiblingFailed name

-- | Runs the body of the operator with this name, which starts branches and gives a verdict; stops the
-- branches that still run, and gives the outcome.
structured :: String -> (Scope -> IO (Verdict a)) -> IO a
structured name = operatorSpan name (inScope name)
{-# INLINE structured #-}

inScope :: String -> (Scope -> IO (Verdict a)) -> IO a
inScope name body = do
  state <- getMaskingState
  mask $ \restore -> do
    scope <- Scope name <$> newIORef []
    -- (Written as @body scope@ it would be a thunk first, in every operator.)
    verdict <- try (restore (pure scope >>= body))
    (thrown, faults) <- stopAll scope state (either causeOf causeIn verdict) (either Just (const Nothing) verdict)
    deadlocked <- maybe (pure False) isDeadlock thrown
    case (thrown, faults) of
      (Just e, []) | not deadlocked -> throwIO e
      (Just e, fault : _) | not deadlocked -> withFault e fault
      -- An exception thrown at the caller while it could not be interrupted is received here,
      -- and not later, when the outcome has been thrown into one of the caller's handlers.
      (_, []) -> restore checkpoint >> either throwIO verdictToIO verdict
      (_, fault : _) -> do
        restore checkpoint `catch` \e -> withFault e fault
        throwIO fault
 where
  causeIn (Verdict cause _) = cause
  verdictToIO (Verdict _ act) = act
  withFault e fault = defined e >>= \e' -> throwIO (StoppedWithFault e' fault)

-- | Whether GHC threw it because it detected a deadlock. GHC throws that both to a branch and
-- to the operator that waits for the branch, so a fault of the branch comes first.
isDeadlock :: SomeException -> IO Bool
isDeadlock thrown = defined thrown >>= \e -> pure $ case (fromException e, fromException e) of
  (Just BlockedIndefinitelyOnSTM, _) -> True
  (_, Just BlockedIndefinitelyOnMVar) -> True
  _ -> False

-- | Stops everything in the scope, for this cause. Gives what has been thrown at the caller (before, or while
-- this waits), and the faults from left to right.
--
-- A caller that is not masked can be interrupted here, as long as nothing has been thrown at
-- it: so a cleanup may throw to it. After that it cannot, or branches would be orphaned; a
-- later exception stays pending, in GHC's own queue, from which it can be withdrawn. (If it
-- were received here and thrown again later, a time limit could interrupt what comes after
-- the end of that limit.)
-- A caller that is masked cannot be interrupted here at all: it must not lose the verdict.
stopAll :: Scope -> MaskingState -> Cause -> Maybe SomeException -> IO (Maybe SomeException, [SomeException])
stopAll scope state cause before =
  readIORef (branches scope) >>= \case
    [] -> pure (before, [])
    newestFirst -> do
      (thrown, ()) <- interruptibleOnce before (requestStop cause newestFirst)
      (thrown', faults) <- foldM withFault (thrown, []) (reverse newestFirst)
      -- (Evaluated: otherwise each operator would allocate a thunk for that.)
      pure $! (,) thrown' $! reverse faults
 where
  withFault (thrown, faults) (SomeBranch b) = do
    (thrown', o) <-
      tryReadThenBlock
        (fmap ((,) thrown) <$> tryReadOutcome b)
        (interruptibleOnce thrown (atomically (outcome b)))
    pure $! case o of
      FaultedWith e -> (thrown', e : faults)
      _ -> (thrown', faults)
  -- Waits interruptibly until something is thrown; from then on uninterruptibly.
  interruptibleOnce thrown wait = case thrown of
    Nothing | state == Unmasked -> do
      waited <- try wait
      case waited of
        Right a -> pure (Nothing, a)
        Left e -> do
          deadlocked <- isDeadlock e
          (,) (if deadlocked then Nothing else Just e) <$> awaitUninterruptibly wait
    _ -> (,) thrown <$> awaitUninterruptibly wait

-- | Starts the branch with this name.
branch :: Scope -> String -> IO a -> IO (Branch a)
branch scope name act = branchWith plainly scope name (const act)

-- | How a branch is started.
data Starting a = Starting
  { placement :: Placement
  -- ^ On which capability.
  , hook :: Outcome a -> STM ()
  -- ^ Part of the transaction that publishes how the branch ended.
  }

-- | Placed like the thread that starts it, and with no hook.
plainly :: Starting a
plainly = Starting {placement = Inherited, hook = \_ -> pure ()}

-- | Starts the branch with this name. Its action can read whether its stop was requested; one that runs a user's
-- action in a loop must read it: the user's action may have swallowed the request.
branchWith :: Starting a -> Scope -> String -> (IO Bool -> IO a) -> IO (Branch a)
branchWith how scope name act = mask_ $ do
  requested <- newIORef False
  let label = Label (operator scope) name
  thread <- startWith (placement how) classify (hook how) label (act (readIORef requested))
  let new = Branch {branchThread = thread, stopRequested = requested}
  modifyIORef' (branches scope) (SomeBranch new :)
  pure new
{-# INLINE branchWith #-}

-- | Removes from the scope a branch that has ended and did not fault. Otherwise the scope
-- would grow with every branch that an operator ever started. (It is mostly the newest one.)
forget :: Scope -> Branch a -> IO ()
forget scope old = modifyIORef' (branches scope) without
 where
  without [] = []
  without (SomeBranch b : others)
    | branchId b == branchId old = others
    | otherwise = SomeBranch b : without others

-- | Removes from the scope all branches that have ended and did not fault, in one walk over it, and
-- gives how many are left. (To 'forget' one is a walk over all that are newer.)
forgetEnded :: Scope -> IO Int
forgetEnded scope = do
  (left, oldestFirst) <- readIORef (branches scope) >>= foldM without (0, [])
  left <$ (writeIORef (branches scope) $! reverse oldestFirst)
 where
  without (left, others) this@(SomeBranch b) = do
    end <- tryReadOutcome b
    pure $! case end of
      Nothing -> keep
      Just (FaultedWith _) -> keep
      Just _ -> (left, others)
   where
    keep = let left' = left + 1 :: Int in left' `seq` (left', this : others)

-- | Requests the stop of all the branches together, by helper threads: a branch that cannot be
-- interrupted at the moment does not delay the request of another. It does not wait until
-- they have stopped; so an interruption of the caller withdraws no request.
requestStopAsync :: Cause -> [SomeBranch] -> IO ()
requestStopAsync cause these = mask_ $ claimStopRequests these >>= throwToAll (`Stop` cause)

-- | Like 'requestStopAsync', for a caller that then waits for the end of all of them, and may
-- block here, too: the request for a single branch needs no helper thread, and so costs less.
requestStop :: Cause -> [SomeBranch] -> IO ()
requestStop cause these = mask_ $
  claimStopRequests these >>= \case
    [] -> pure ()
    [thread] -> throwToOne thread (Stop thread cause)
    threads -> throwToAll (`Stop` cause) threads

-- | The threads of the branches whose stop is still to be requested; marks it as requested.
claimStopRequests :: [SomeBranch] -> IO [ThreadId]
claimStopRequests = foldM requested []
 where
  requested threads (SomeBranch b) = do
    needed <- claimStopRequest b
    pure $! if needed then branchId b : threads else threads

-- | Marks the stop of a branch as requested. False if it was already, or the branch has ended.
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

-- | How the branch ended, if it has. Does not block.
tryReadOutcome :: Branch a -> IO (Maybe (Outcome a))
tryReadOutcome = tryReadEnd . branchThread

-- | What the branch returned, if it has. Does not block.
completedNow :: Branch a -> IO (Maybe a)
completedNow b = (>>= either (const Nothing) Just . result) <$> tryReadOutcome b
