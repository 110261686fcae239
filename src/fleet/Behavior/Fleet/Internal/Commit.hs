{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What a task writes when it completes.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Commit
  ( Commit (..)
  , writing
  , instead
  ) where

import Control.Concurrent.STM (STM)
import Database.PostgreSQL.Simple (Connection)

-- | The result of a task, and what is written in the transaction in which the task completes: both are committed, or
-- neither. ('pure' writes nothing.)
--
-- @since 0.1.0.0
data Commit o
  = WritesNothing o
  | -- | And what a fake database does in its place, in the same transaction.
    Writes (Connection -> IO o) (Maybe (STM o))

instance Functor Commit where
  fmap f (WritesNothing o) = WritesNothing (f o)
  fmap f (Writes act fake) = Writes (fmap f . act) (fmap f <$> fake)

instance Applicative Commit where
  pure = WritesNothing
  WritesNothing f <*> other = f <$> other
  Writes act fake <*> other = case other of
    WritesNothing o -> ($ o) <$> Writes act fake
    Writes more fakeMore -> Writes (\c -> act c <*> more c) ((<*>) <$> fake <*> fakeMore)

-- | Writes, in the transaction in which the task completes.
--
-- > serving fleet orders $ \order -> do
-- >   carry order
-- >   pure (writing (\c -> void (execute c "insert into delivered (place) values (?)" (Only (place order)))))
--
-- It may run more than once, and then all but one of them are rolled back: so it does nothing but write to this
-- database. It must neither begin nor end a transaction (@withSavepoint@ is allowed; what a @withTransaction@ has
-- committed is written, and the start has failed nevertheless), and not keep the connection. A lease that is lost
-- meanwhile is noticed at the end of the transaction: nothing is written then.
--
-- [Failure, fault] Nothing is written, and that start of the task has failed.
-- [Cancellation] Nothing is written, or all is: see 'Behavior.Fleet.serving'.
--
-- @since 0.1.0.0
writing :: (Connection -> IO o) -> Commit o
writing act = Writes act Nothing

-- | What a 'Behavior.Fleet.Fake.fakeDatabase' does in place of what is written, when the task completes there.
--
-- @since 0.1.0.0
instead :: STM o -> Commit o -> Commit o
instead fake wanted = case wanted of
  WritesNothing o -> WritesNothing o
  Writes act _ -> Writes act (Just fake)
