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

-- $setup
-- >>> import Behavior
-- >>> import Behavior.STM

-- | A place where behaviours run beside a 'scoped' one.
--
-- @since 0.1.0.0
newtype Nursery = Nursery (TVar Stage)

-- | How far a nursery has come.
data Stage
  = -- | What is requested of it, the newest first.
    Open [Request]
  | -- | All is being stopped. A child may be just forking; a cleanup may fork, too.
    Ending
  | -- | All has ended.
    Closed

-- | What only the thread of the scope does: to start a branch, and to stop one.
data Request
  = -- | ... and where to put what was started.
    forall a. Fork (Behavior a) (TMVar (Branch a))
  | Stop SomeBranch

-- | A behaviour that was forked, and what can be known of it: its result, or how else it
-- ended.
--
-- @since 0.1.0.0
data Child a = Child (TVar Stage) (Branch a)

-- | The failure of whoever awaits the result of a child that was stopped.
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
-- [Result] That of the behaviour. What was forked is then asked to stop, all at
--   once, and has ended when 'scoped' returns.
-- [Failure] If a forked behaviour fails, the scoped one and all the others are
--   stopped, and that failure is thrown. (One that is stopped by 'requestStop' has not
--   failed.)
-- [Fault] The leftmost fault (the scoped behaviour's before those of the forked,
--   in the order in which they were forked), in a cleanup too, is always thrown.
-- [Cancellation] All are asked to stop at once; it returns after all have ended.
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
  structured (\scope -> serveRequests stage scope (body (Nursery stage)) `finally` atomically (writeTVar stage Ending))
    `finally` atomically (writeTVar stage Closed)

-- | Starts and stops children as it is requested, until there is a verdict.
serveRequests :: TVar Stage -> Scope -> Behavior a -> IO (IO a)
serveRequests stage scope body = do
  failure <- newLeftmost
  main <- branch scope (Label "scoped" "body") body
  let -- How many were forked; those that may live yet; and the number at which to look for
      -- those that do not.
      serve count children sweepAt = do
        next <- atomically (asum [Left . outcomeToIO <$> outcome main, Left . throwIO <$> readLeftmost failure, Right <$> requested])
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
        Stop child -> (count, children) <$ requestStopAsync [child]
        Fork act accepted -> do
          let n = count + 1 :: Int
          -- Masked: what was started is also handed over.
          child <- mask_ $ do
            new <- branchWithHook (traverse_ (publish failure n) . thrownBy) scope (Label "scoped" "fork") act
            new <$ atomically (putTMVar accepted new)
          pure (n, SomeBranch child : children)
      requested =
        readTVar stage >>= \case
          Open new@(_ : _) -> reverse new <$ writeTVar stage (Open [])
          _ -> retry
      -- Of those that have ended without trouble nothing is kept.
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
-- [Failure] While all is being stopped (in a cleanup, say, or in a child that forks as the
--   scoped behaviour returns) nothing is started any more: it fails.
-- [Fault] Outside its 'scoped' the nursery is closed: an 'ErrorCall' says so.
-- [Cancellation] It may have been started then; it is stopped with the rest.
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
-- It never waits for ever for a child that has ended, however that was: a cleanup may
-- await one. (What a child throws also ends its 'scoped', whether it is awaited or not.)
--
-- @since 0.1.0.0
await :: Child a -> STM a
await = tryAwait >=> maybe retry (either throwSTM pure)

-- | How a child has ended, if it has: the result, or what 'await' would throw. It does not
-- wait.
--
-- To wait for the end, however that is, write @tryAwait child >>= maybe retry pure@.
--
-- @since 0.1.0.0
tryAwait :: Child a -> STM (Maybe (Either SomeException a))
tryAwait (Child _ child) = fmap ending <$> tryReadOutcomeSTM child
 where
  ending = \case
    Stopped _ -> Left (toException ChildStopped)
    end -> result end

-- | Asks a child to stop, and does not wait until it has. If it has ended, or was asked
-- before, this changes nothing.
--
-- A child that is stopped is no failure of its 'scoped'. What its cleanup throws counts like
-- everything that a child throws; and if it completes all the same, its result stands.
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
