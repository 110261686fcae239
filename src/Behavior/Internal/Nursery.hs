{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE ExistentialQuantification #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Behaviours that run beside a scoped one.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Nursery
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
import Control.Monad (filterM, foldM, (>=>))
import Data.Foldable (asum, traverse_)

import Behavior.Internal.Failure
import Behavior.Internal.Leftmost
import Behavior.Internal.Runtime (Label (..), atomically)
import Behavior.Internal.Scope hiding (requestStop)
import Behavior.Internal.Trace.Event (Cause (..))

-- $setup
-- >>> import Behavior
-- >>> import Behavior.STM

-- | A place where behaviours run beside a 'scoped' one.
--
-- @since 0.1.0.0
newtype Nursery = Nursery (TVar Stage)

-- | The stage of a nursery.
data Stage
  = -- | The requests to the scope's thread, the newest first.
    Open [Request]
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
data Child a = Child (TVar Stage) (Branch a)

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
  stage <- newTVarIO (Open [])
  structured "scoped" (\scope -> serveRequests stage scope (body (Nursery stage)) `finally` atomically (writeTVar stage Ending))
    `finally` atomically (writeTVar stage Closed)

-- | Serves the requests to start and stop children, until there is a verdict.
serveRequests :: TVar Stage -> Scope -> Behavior a -> IO (Verdict a)
serveRequests stage scope body = do
  failure <- newLeftmost
  main <- branch scope (Label "scoped" "body") body
  let -- How many were forked; the children that may still run; and the number of forks at which
      -- to remove those that have ended.
      serve count children sweepAt = do
        next <- atomically (asum [Left . endedBy "body" <$> outcome main, Left . thrown <$> readLeftmost failure, Right <$> requested])
        case next of
          Left verdict -> pure verdict
          Right new -> do
            (count', children') <- foldM handleRequest (count, children) new
            if count' < sweepAt
              then serve count' children' sweepAt
              else do
                running <- filterM mayRun children'
                serve count' running (count' + max 16 (length running))
      handleRequest (count, children) = \case
        Stop child -> (count, children) <$ requestStopAsync (FromOutside "requestStop") [child]
        Fork act accepted -> do
          let n = count + 1 :: Int
          -- Masked: a branch that was started is also handed over.
          child <- mask_ $ do
            new <- branchWithHook (traverse_ (publish failure n) . thrownBy) scope (Label "scoped" "fork") act
            new <$ atomically (putTMVar accepted new)
          pure (n, SomeBranch child : children)
      thrown (n, e) = Verdict (SiblingFailed ("fork " ++ show n)) (throwIO e)
      requested =
        readTVar stage >>= \case
          Open new@(_ : _) -> reverse new <$ writeTVar stage (Open [])
          _ -> retry
      -- Nothing is kept of a child that has ended without an exception.
      mayRun (SomeBranch child) =
        tryReadOutcome child >>= \end -> case thrownBy <$> end of
          Just Nothing -> False <$ forget scope child
          _ -> pure True
  serve 0 [] 16

-- | What a child has thrown, unless it was stopped.
thrownBy :: Outcome a -> Maybe SomeException
thrownBy = \case
  Completed _ -> Nothing
  Stopped _ -> Nothing
  Failing e -> Just e
  Faulted e -> Just e

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
fork (Nursery stage) act = do
  accepted <- newEmptyTMVarIO
  atomically $
    readTVar stage >>= \case
      Open waiting -> writeTVar stage (Open (Fork act accepted : waiting))
      Ending -> failEnding
      Closed -> throwSTM (ErrorCall "fork: the nursery's scoped behaviour has ended")
  Child stage <$> atomically (takeTMVar accepted `orElse` unlessOpen)
 where
  unlessOpen =
    readTVar stage >>= \case
      Open _ -> retry
      _ -> failEnding
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
requestStop (Child stage child) =
  atomically $
    readTVar stage >>= \case
      Open waiting -> writeTVar stage (Open (Stop (SomeBranch child) : waiting))
      -- It is being stopped with the rest, or has ended.
      _ -> pure ()
