{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE RankNTypes #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- PostgreSQL.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Postgres
  ( postgres
  ) where

import Control.Concurrent (rtsSupportsBoundThreads, threadWaitReadSTM)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (unless, void, when, (>=>))
import Data.ByteString (ByteString)
import qualified Data.ByteString.Char8 as Bytes
import qualified Data.Text as Text
import qualified Data.UUID.Types as UUID
import qualified Data.UUID.V4 as UUID
import qualified Database.PostgreSQL.LibPQ as PQ
import Database.PostgreSQL.Simple hiding (commit)
import Database.PostgreSQL.Simple.Internal (withConnection)
import Database.PostgreSQL.Simple.Notification (Notification (..), getNotificationNonBlocking)
import System.Clock (Clock (Boottime), getTime, toNanoSecs)
import System.Posix.Types (Fd)
import Text.Read (readMaybe)

import Behavior (Behavior, catchAny)
import Behavior.Fleet.Internal.Commit
import Behavior.Fleet.Internal.Connect
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Database
import Behavior.Fleet.Internal.Error (ConnectionLost (..))
import Behavior.Fleet.Internal.Sql (called)
import Behavior.Fleet.Internal.Version (noFleet)
import Behavior.STM (atomically)
import Behavior.Time (abandoning, cleanupWithin)

-- | The database at that address (libpq's: @"host=/run/postgresql dbname=fleet"@, or @"postgresql://..."@).
--
-- What the address does not say comes from libpq's environment (@PGHOST@, @PGPASSFILE@, ...). So no password is in it.
--
-- @since 0.1.0.0
postgres :: String -> Database
postgres address =
  Database
    { databaseName = "the fleet's database"
    , newUnique = UUID.nextRandom
    , ownClock = (/ 1e9) . fromIntegral . toNanoSecs <$> getTime Boottime
    , opening = \limit use -> bracket (connected limit address) close (sessionOver >=> use)
    }

sessionOver :: Connection -> IO Session
sessionOver connection = do
  socket <- losing (withConnection connection PQ.socket >>= maybe (throwIO (ConnectionLost "it has no socket")) pure)
  hasAnswered <- newTVarIO False
  pure
    Session
      { ask = \request ->
          statement connection refusalIn (called connection request) <* atomically (writeTVar hasAnswered True)
      , commit = \task lease json wanted ->
          statement connection (const Nothing) . withTransaction connection $ do
            o <- (written connection wanted <* stillInTransaction connection) `catchAny` \why -> do
              isThere <- (== PQ.ConnectionOk) <$> withConnection connection PQ.status
              throwIO (if isThere && not (maybe False isLoss (fromException why)) then toException (Users why) else why)
            o <$ refusing (query connection "select fleet.complete(?, ?, ?)" (task, lease, json o) :: IO [Only ()])
      , listen = losing (void (execute_ connection "listen fleet"))
      , -- (A notice may have come together with an answer: then nothing of it is left at the socket.)
        awaitNews = bracket (threadWaitReadSTM (socket :: Fd)) snd $ \(isReadable, _) ->
          atomically (isReadable `orElse` (readTVar hasAnswered >>= check >> writeTVar hasAnswered False))
      , takeNews = losing (news connection <* stillThere connection)
      }

-- | (libpq has closed the socket of a connection that the server has ended: so that must not be waited for.)
stillThere :: Connection -> IO ()
stillThere connection = do
  status <- withConnection connection PQ.status
  unless (status == PQ.ConnectionOk) $ throwIO (ConnectionLost hasEnded)

-- | What a task writes must leave the transaction to its completion. (What has ended it is committed without that.)
stillInTransaction :: Connection -> IO ()
stillInTransaction connection = do
  stillThere connection
  withConnection connection PQ.transactionStatus >>= \case
    PQ.TransInTrans -> pure ()
    PQ.TransInError -> throwIO . ErrorCall $
      "writing: a statement has failed, and so the whole transaction has. Its exception must not be caught; or the \
      \statement must be in withSavepoint"
    _ -> throwIO . ErrorCall $
      "writing: what the task writes has ended the transaction in which the task is completed. It must have no begin, \
      \commit, rollback or withTransaction; withSavepoint is allowed"

written :: Connection -> Commit o -> IO o
written connection = \case
  WritesNothing o -> pure o
  Writes act _ -> act connection

-- | A statement; what the schema refuses; and what no connection survives, as 'ConnectionLost'. When it is interrupted,
-- the server is asked to end it, too.
statement :: Connection -> (SqlError -> Maybe Refusal) -> IO a -> Behavior (Either Refusal a)
statement connection refusal act =
  (Right <$> losing act)
    `catches` [Handler refused, Handler (\(Refused why) -> pure (Left why)), Handler (\(Users why) -> throwIO why)]
    `onException` cancelThere connection
 where
  refused e = maybe (throwIO e) (pure . Left) (refusal e)

-- | What the schema refuses, in a transaction in which all else is the user's: also what its commit throws.
refusing :: IO a -> IO a
refusing act = act `catch` \e -> maybe (throwIO e) (throwIO . Refused) (refusalInWrites e)

newtype Refused = Refused Refusal
  deriving (Show)

instance Exception Refused

-- | What the user's own writes have thrown: it says nothing of the connection.
newtype Users = Users SomeException
  deriving (Show)

instance Exception Users

-- | What the functions of the schema refuse; and that they are not there, or this user may not call them.
refusalIn :: SqlError -> Maybe Refusal
refusalIn e = case sqlState e of
  "3F000" -> Just (NoFleet (Text.pack noFleet))
  -- (An undefined function, table, column or type.)
  code | code `elem` ["42883", "42P01", "42703", "42704"] ->
    Just (NoFleet ("the schema of the fleet's database is damaged (" <> why <> "): behavior-fleet migrate says more"))
  "42501" ->
    Just . NoFleet $
      "the fleet's database refuses this user (" <> why <> "): run, as the owner, grant fleet_robot to USER; "
        <> "if that does not help, run behavior-fleet migrate, which mends roles and rights"
  _ -> refusalInWrites e
 where
  why = text (sqlErrorMsg e)

-- | Of a transaction in which the user writes, too.
refusalInWrites :: SqlError -> Maybe Refusal
refusalInWrites e = case sqlState e of
  "FL001" -> Just LeaseGone
  "FL002" -> Just (BadArgument why)
  "FL003" -> Just (WasRestored why)
  "55P03" -> Just Busy
  -- (Data exceptions, and limits of the program: what no column can hold.)
  code | any (`Bytes.isPrefixOf` code) ["22", "54"] -> Just (BadArgument (why <> detail))
  _ -> Nothing
 where
  why = text (sqlErrorMsg e)
  detail = if Bytes.null (sqlErrorDetail e) then "" else ": " <> text (sqlErrorDetail e)

-- | Has the server end what it does for this connection. (That is a connection of its own, which libpq waits for: and
-- the server may be frozen.)
cancelThere :: Connection -> IO ()
cancelThere connection = when rtsSupportsBoundThreads . void . cleanupWithin 0.3 . abandoning 0.1 $
  withConnection connection PQ.getCancel >>= maybe (pure ()) (void . PQ.cancel)

news :: Connection -> IO [Notice]
news connection = getNotificationNonBlocking connection >>= \case
  Nothing -> pure []
  Just it -> (noticeOf (notificationData it) :) <$> news connection

noticeOf :: ByteString -> Notice
noticeOf said = case Bytes.break (== ' ') said of
  ("queue", name) -> OfQueue (text (Bytes.drop 1 name))
  ("later", _) -> OfLater
  ("resource", name) -> OfResource (text (Bytes.drop 1 name))
  ("line", name) -> OfLine (text (Bytes.drop 1 name))
  ("turn", number) | Just n <- UUID.fromASCIIBytes (Bytes.drop 1 number) -> OfTurn n
  ("task", number) | Just n <- readMaybe (Bytes.unpack number) -> OfTask (TaskNumber n)
  ("cancel", number) | Just n <- readMaybe (Bytes.unpack number) -> OfCancel (TaskNumber n)
  _ -> OfAnything

