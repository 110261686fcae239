{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE ExistentialQuantification #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Behaviours that run beside a scoped one.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Concurrent.Nursery
  ( -- * Scoped behaviours
    Nursery
  , scoped
  , fork

    -- * Children
  , Child
  , await
  , tryAwait
  , requestStop
  , ChildStopped (..)
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (ErrorCall (..), Exception (..), SomeException, finally, mask_, throwIO)
import Control.Monad (foldM, unless, (>=>))
import Control.Monad.Catch (MonadThrow)
import Data.Foldable (asum, traverse_)

import Behavior.Internal.Concurrent.Leftmost
import Behavior.Internal.Concurrent.Outcome (Outcome (..), result)
import Behavior.Internal.Concurrent.Scope hiding (requestStop)
import Behavior.Internal.Core.Cause (Cause (..))
import Behavior.Internal.Core.Failure
import Behavior.Internal.Seam.Runtime (atomically)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.STM

-- | A place where behaviours run beside a 'scoped' one.
--
-- (The state and the requests are in separate variables: a thread that waits in 'fork' reads the
-- state, and must not be woken by each request of another.)
--
-- @since 0.1.0.0
data Nursery = Nursery
  { state :: !(TVar NurseryState)
  , requests :: !(TVar [Request])
  -- ^ Those that the scope's thread has not served yet, the newest first.
  }

-- | The state of a nursery.
data NurseryState
  = Open
  | -- | Everything is being stopped. A child may be forking just then; a cleanup may fork, too.
    Ending
  | -- | Everything has ended.
    Closed

-- | What only the scope's thread does: it starts a branch, or stops one.
data Request
  = -- | Starts the behaviour, and puts the branch into the variable.
    forall a. Fork (Behavior a) (TMVar (Branch a))
  | Stop SomeBranch

-- | The handle of a forked behaviour: it gives the behaviour's result, or how else it ended.
--
-- @since 0.1.0.0
data Child a = Child !Nursery !(Branch a)

-- | The failure that 'await' throws for a child that was stopped.
--
-- @since 0.1.0.0
data ChildStopped = ChildStopped
  deriving (Eq, Show)

instance Exception ChildStopped where
  toException = behaviorFailedToException
  fromException = behaviorFailedFromException
  displayException ChildStopped = "the forked behaviour was stopped before it had a result"

-- | Runs a behaviour that may 'fork' others, which are stopped when it ends.
--
-- [Result] That of the behaviour. Then the stop of the forked behaviours is requested, of all
--   together; they have ended when 'scoped' returns.
-- [Failure] If a forked behaviour fails, the scoped one and all the others are
--   stopped, and that failure is thrown. (One that is stopped by 'requestStop' has not
--   failed.)
-- [Fault] The leftmost fault (the scoped behaviour's before those of the forked,
--   in the order in which they were forked), in a cleanup too, is always thrown.
-- [Cancellation] Requests the stop of all together; returns after all have ended.
--
-- A child costs the same, however many there are. Of the children that have ended, the nursery keeps at most
-- twice as many as ran at the same time, or 16.
--
-- >>> :{
-- scoped $ \nursery -> do
--   picture <- fork nursery (pure "a picture of the room")
--   putStrLn "driving on meanwhile"
--   atomically (await picture)
-- :}
-- driving on meanwhile
-- "a picture of the room"
--
-- @since 0.1.0.0
scoped :: (Nursery -> Behavior a) -> Behavior a
scoped body = do
  nursery <- Nursery <$> newTVarIO Open <*> newTVarIO []
  let enter = atomically . writeTVar (state nursery)
  structured "scoped" (\scope -> serveRequests nursery scope (body nursery) `finally` enter Ending)
    `finally` enter Closed

-- | Serves the requests to start and stop children, until there is a verdict.
serveRequests :: Nursery -> Scope -> Behavior a -> IO (Verdict a)
serveRequests nursery scope body = do
  failure <- newLeftmost
  main <- branch scope "body" body
  let -- How many were forked, and at which number the scope is to forget those that have ended. To forget
      -- is a walk over all branches: so the next one comes after as many forks as this one has left branches.
      serve count sweepAt = do
        next <-
          atomically $
            asum [Left . endedBy "body" <$> outcome main, Left . thrown <$> readLeftmost failure, Right <$> requested]
        case next of
          Left verdict -> pure verdict
          Right new -> do
            let stops = [child | Stop child <- new]
            unless (null stops) $ requestStopAsync (FromOutside "requestStop") stops
            count' <- foldM startChild count new
            if count' < sweepAt
              then serve count' sweepAt
              else forgetEnded scope >>= \left -> serve count' (count' + max 16 left)
      startChild count = \case
        Stop _ -> pure count
        Fork act accepted -> do
          let n = count + 1 :: Int
          -- Masked, so that each branch that was started is also handed over.
          mask_ $
            branchWith plainly {hook = traverse_ (publish failure n) . thrownBy} scope "fork" (const act)
              >>= atomically . putTMVar accepted
          pure n
  serve 0 16
 where
  thrown (n, e) = Verdict (SiblingFailed ("fork " ++ show n)) (throwIO e)
  requested =
    readTVar (requests nursery) >>= \new -> check (not (null new)) >> reverse new <$ writeTVar (requests nursery) []

-- | What a child has thrown, unless it was stopped.
thrownBy :: Outcome a -> Maybe SomeException
thrownBy = \case
  Completed _ -> Nothing
  Stopped _ -> Nothing
  FailedWith e -> Just e
  FaultedWith e -> Just e

-- | Starts a behaviour that runs until it ends by itself, is stopped by 'requestStop', or
-- 'scoped' ends. It has been started when 'fork' returns.
--
-- [Result] A handle: see 'await', 'tryAwait' and 'requestStop'.
-- [Failure] While everything is being stopped (in a cleanup, say, or in a child that forks as the
--   scoped behaviour returns) nothing is started any more: it fails.
-- [Fault] Outside its 'scoped' the nursery is closed: it throws an 'ErrorCall'.
-- [Cancellation] The behaviour may already have been started; it is stopped with the rest.
--
-- @since 0.1.0.0
fork :: Nursery -> Behavior a -> Behavior (Child a)
fork nursery act = do
  accepted <- newEmptyTMVarIO
  -- (Not a transaction: without -threaded, one that only reads a variable also wakes the threads that wait for
  -- that variable. If the state changes between this reading and the request, the request is not served.)
  readTVarIO (state nursery) >>= \case
    Open -> atomically (request nursery (Fork act accepted))
    Ending -> failEnding
    Closed -> throwIO (ErrorCall "fork: the nursery's scoped behaviour has ended")
  Child nursery <$> atomically (takeTMVar accepted `orElse` unlessOpen)
 where
  unlessOpen =
    readTVar (state nursery) >>= \case
      Open -> retry
      _ -> failEnding
  failEnding :: MonadThrow m => m a
  failEnding = failWith "fork: the nursery's scoped behaviour is ending"

-- | The result of a child; retries until the child has ended, cleanup included.
--
-- > await child  =  tryAwait child >>= maybe retry (either throwSTM pure)
--
-- [Result] The child's.
-- [Failure] The child's; 'ChildStopped' if it was stopped, by 'requestStop' or because its
--   'scoped' ended.
-- [Fault] The child's, also of its cleanup.
--
-- For a child that has ended, however it ended, it does not block: so a cleanup may
-- await one. (What a child throws also ends its 'scoped', whether it is awaited or not.)
--
-- @since 0.1.0.0
await :: Child a -> STM a
await = tryAwait >=> maybe retry (either throwSTM pure)

-- | How a child has ended, if it has: the result, or what 'await' would throw. It does not
-- block.
--
-- To wait for the end, of whatever kind, write @tryAwait child >>= maybe retry pure@.
--
-- @since 0.1.0.0
tryAwait :: Child a -> STM (Maybe (Either SomeException a))
tryAwait (Child _ child) = fmap ending <$> tryReadOutcomeSTM child
 where
  ending = \case
    Stopped _ -> Left (toException ChildStopped)
    end -> result end

-- | Requests the stop of a child, and does not wait until it has stopped. If the child has ended,
-- or its stop has already been requested, this has no effect.
--
-- A stopped child does not make its 'scoped' fail. What its cleanup throws counts like
-- everything that a child throws; and if it completes nevertheless, its result stands.
--
-- >>> :{
-- scoped $ \nursery -> do
--   music <- fork nursery (sleep 3600)
--   requestStop music
--   atomically (await music) ? putStrLn "silence"
-- :}
-- silence
--
-- @since 0.1.0.0
requestStop :: Child a -> Behavior ()
requestStop (Child nursery child) =
  readTVarIO (state nursery) >>= \case
    Open -> atomically (request nursery (Stop (SomeBranch child)))
    -- It is being stopped with the rest, or has ended.
    _ -> pure ()

request :: Nursery -> Request -> STM ()
request nursery new = modifyTVar' (requests nursery) (new :)
