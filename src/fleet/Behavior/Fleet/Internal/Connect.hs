{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- Connecting to PostgreSQL, and what shows that a connection is of no use.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Connect
  ( connected
  , losing
  , isLoss
  , hasEnded
  , text
  ) where

import Control.Concurrent (newMVar, rtsSupportsBoundThreads)
import Control.Exception hiding (IOException)
import Control.Monad (unless, void)
import Data.ByteString (ByteString)
import qualified Data.ByteString as Bytes
import Data.Char (isSpace)
import Data.IORef (newIORef)
import Data.List (isInfixOf, isPrefixOf, isSuffixOf)
import Data.Maybe (fromMaybe)
import Data.Text (Text)
import qualified Data.Text as Text
import Data.Text.Encoding (decodeUtf8With, encodeUtf8)
import Data.Text.Encoding.Error (lenientDecode)
import qualified Database.PostgreSQL.LibPQ as PQ
import Database.PostgreSQL.Simple
import Database.PostgreSQL.Simple.Internal (Connection (..), fatalError)
import GHC.IO.Exception (IOException (..))

import Behavior (Seconds, (?))
import Behavior.Fleet.Internal.Error (ConnectionLost (..))
import Behavior.Time (abandoning, timeout)

-- | Connects to the database at this address, each server of which has that many seconds to answer, and prepares the
-- connection.
connected :: Seconds -> String -> IO Connection
connected limit address = losing $ do
  connection <-
    timeout inAll (if rtsSupportsBoundThreads then abandoning 0.1 (byLibpq bytes) else connectPostgreSQL bytes)
      ? throwIO (TooSlow ("no connection within " ++ show inAll ++ " s"))
  (`onException` close connection) $ do
    -- A transaction whose client is gone or hangs must not hold locks for long.
    void . execute_ connection $
      "set client_connection_check_interval = '100ms'; set idle_in_transaction_session_timeout = '10s'; \
      \set client_min_messages = warning; set search_path = public, pg_temp; \
      \set default_transaction_isolation = 'read committed'"
    -- (What is committed must be there after a crash.)
    _ <- query_ connection
      "select set_config('synchronous_commit', 'on', false) where current_setting('synchronous_commit') = 'off'"
      :: IO [Only Text]
    pure connection
 where
  bytes = encodeUtf8 (Text.pack (withLimit limit address))
  -- (For two servers.)
  inAll = 2.5 * limit

-- | 'connectPostgreSQL' has no limit for each server of an address: so it never asks the second one while the first one
-- is frozen. libpq has one, but nothing interrupts it.
byLibpq :: ByteString -> IO Connection
byLibpq address = do
  it <- PQ.connectdb address
  status <- PQ.status it
  unless (status == PQ.ConnectionOk) $ PQ.errorMessage it >>= throwIO . fatalError . fromMaybe ""
  connection <- Connection <$> newMVar it <*> newMVar mempty <*> newIORef 0
  connection <$ execute_ connection
    "set datestyle to iso; set client_encoding to utf8; set standard_conforming_strings to on"

-- | With a limit for each server, unless the address has one.
withLimit :: Seconds -> String -> String
withLimit limit address
  | "connect_timeout" `isInfixOf` address = address
  | any (`isPrefixOf` address) ["postgresql://", "postgres://"] =
      address ++ (if '?' `elem` address then "&" else "?") ++ seconds
  | otherwise = seconds ++ " " ++ address
 where
  seconds = "connect_timeout=" ++ show (ceiling limit :: Int)

-- | What shows that the connection is of no use, or the database not ready, as 'ConnectionLost'.
losing :: IO a -> IO a
losing act = act `catches` [Handler ofServer, Handler ofClient]
 where
  ofServer e = if isLoss e then lost (Text.unpack (text (sqlErrorMsg e))) else throwIO e
  -- (What libpq says is in the description: a line for each server, in English, for GHC's runtime chooses no language.)
  ofClient e = lost (if ioe_location e == "libpq" then ioe_description e else show e)
  lost why
    | all isSpace why = throwIO (ConnectionLost hasEnded)
    | all ("timeout expired" `isSuffixOf`) (lines why) = throwIO (TooSlow (unwords (words why)))
    | otherwise = throwIO (ConnectionLost (unwords (words why)))

-- | Why, if libpq does not say it.
hasEnded :: String
hasEnded = "the server has ended the connection"

-- | Whether the database is gone, or not ready.
isLoss :: SqlError -> Bool
isLoss e = Bytes.null (sqlState e) || sqlExecStatus e == FatalError && isPassing (sqlState e)
 where
  -- Connection exceptions, insufficient resources, an operator's intervention (the database stops, starts, or has
  -- ended a statement or an idle transaction), read-only (it is a standby), and transactions that are to be tried
  -- again.
  isPassing code = any (`Bytes.isPrefixOf` code) ["08", "53", "57014", "57P", "25P03", "25006", "40"]

-- | A text of the server.
text :: ByteString -> Text
text = decodeUtf8With lenientDecode
