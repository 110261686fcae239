{-# LANGUAGE OverloadedStrings #-}

-- |
-- The program @behavior-fleet@.
module Tool
  ( run
  ) where

import Control.Exception (throwIO, try)
import Data.Char (isSpace, toLower)
import Data.List (isPrefixOf, tails)
import Data.Maybe (listToMaybe, mapMaybe)
import Data.Text (Text)
import qualified Data.Text as Text
import Database.PostgreSQL.Simple (Only (..), Query, query, query_)
import Database.PostgreSQL.Simple.FromField (FromField)
import Options.Applicative
import System.Exit (ExitCode (..))

import Behavior (Behavior, runBehavior)
import Behavior.Fleet.Internal.Migration (withDatabase)
import Behavior.Fleet.Internal.Version (unfit)
import Behavior.Fleet.Schema
import Behavior.Trace.Describe (inert, quotedText)
import Page
import Status

-- | Runs the program with these arguments. The result is its exit status, and what it prints on the standard output and
-- on the standard error output.
run :: [String] -> IO (ExitCode, String, String)
run arguments = case execParserPure defaultPrefs commandLine arguments of
  Success act -> do
    result <- try (runBehavior act)
    pure $ case result of
      Left (SchemaFailure why) -> refused why
      Right printed -> (ExitSuccess, printed, "")
  Failure failure -> pure $ case renderFailure failure "behavior-fleet" of
    (text, ExitSuccess) -> (ExitSuccess, text ++ "\n", "")
    -- (It quotes arguments.)
    (_, _) | any hasPassword arguments -> refused noPassword
    (text, code) -> (code, "", text ++ "\n")
  CompletionInvoked completion -> do
    text <- execCompletion completion "behavior-fleet"
    pure (ExitSuccess, text, "")
 where
  refused why = (ExitFailure 2, "", inert why ++ "\n")

commandLine :: ParserInfo (Behavior String)
commandLine =
  info (helper <*> commands) $
    fullDesc
      <> failureCode 2
      <> progDesc "Keeps the database of a fleet."
      <> footer
        "ADDRESS is libpq's (\"host=/run/postgresql dbname=fleet\", or postgresql://...); what it does not say comes \
        \from libpq's environment (PGHOST, PGDATABASE, PGUSER, PGPASSFILE, ...). Exit status: 0, or 2 if the options \
        \are wrong, or it was not done."

commands :: Parser (Behavior String)
commands =
  hsubparser $
    named "create" (created <$> address) "create the schema in a database, and the roles if they are missing"
      <> named "migrate" (migrated <$> address) "bring the schema, its roles and rights to the version of this program"
      <> named "new-epoch" (renewed <$> term <*> address) "let robots use a database that was restored from a copy"
      <> named "status" (status <$> asJson <*> address) "print queues, robots, leases, and the dead tasks"
      <> named "hub" (shown <$> port <*> address) "serve one live page for all robots that have one"
      <> named "dead" (dead <$> asJson <*> address) "print the dead tasks, and why their last starts failed"
      <> named "retry" (retried <$> queue <*> key <*> address) "give a dead task all its starts again"
      <> named "cancel" (cancelled <$> queue <*> key <*> address) "cancel a task"
 where
  named name act what = command name (info act (progDesc what))
  address = argument (maybeReader Just >>= checked) (metavar "ADDRESS" <> value "" <> help "where the database is")
  checked it = if hasPassword it then readerError noPassword else pure it
  queue = strArgument (metavar "QUEUE" <> help "the name of its queue")
  key = strArgument (metavar "KEY" <> help "its key in the queue")
  term =
    option auto $
      long "term" <> metavar "SECONDS" <> value 60 <> showDefault
        <> help "the longest term for which robots have held a resource: before that is over none is free"
  port = option auto (long "port" <> metavar "PORT" <> value 8410 <> showDefault <> help "the port of the page")
  asJson = switch (long "json" <> help "print all of it as one JSON object")

noPassword :: String
noPassword =
  "an address with a password is refused, for other users of this machine see it: put the password into the file that \
  \PGPASSFILE names, or into PGPASSWORD"

-- | Whether an address has a password.
hasPassword :: String -> Bool
hasPassword address = any isSetting (tails (map toLower address)) || any isUser (tails address)
 where
  isSetting text = "password" `isPrefixOf` text && "=" `isPrefixOf` dropWhile isSpace (drop 8 text)
  isUser text = "://" `isPrefixOf` text && ':' `elem` dropWhile (/= '@') (reverse (drop 3 text))

-- (It ends only if there can be no page.)
shown :: Int -> String -> Behavior String
shown port at = fleetPage port at >>= throwIO . SchemaFailure

created :: String -> Behavior String
created at =
  "The schema is created. Grant the role fleet_robot to the users of robots, and fleet_viewer to those who only look.\n"
    <$ createSchema at

migrated :: String -> Behavior String
migrated at = said <$> migrateSchema at
 where
  said (from, to)
    | from == to =
        "The schema has version " ++ show to ++ ", the newest: nothing is to be done. Its roles and rights are there.\n"
    | otherwise = "The schema had version " ++ show from ++ ", and has version " ++ show to ++ " now.\n"

renewed :: Double -> String -> Behavior String
renewed term at = said <$> newEpoch (realToFrac term) at
 where
  said epoch = "The new epoch is " ++ show epoch ++ ". Start the robots, and those who wait for tasks.\n"

retried :: Text -> Text -> String -> Behavior String
retried queue key at = do
  isDead <- asRobot at "select fleet.retry(?, ?)" (queue, key)
  if isDead then pure "It is waiting.\n" else throwIO (SchemaFailure ("there is no dead task" ++ itsKey queue key))

cancelled :: Text -> Text -> String -> Behavior String
cancelled queue key at = do
  state <- asRobot at "select fleet.cancel(?, ?)::text" (queue, key)
  case state :: Maybe Text of
    Just "cancelled" -> pure "It is cancelled.\n"
    Just "running" -> pure "It runs: it is cancelled when its robot has stopped it, or its lease has expired.\n"
    Just ended -> throwIO (SchemaFailure ("it has ended already, and is " ++ Text.unpack ended))
    Nothing -> throwIO (SchemaFailure ("there is no task" ++ itsKey queue key))

itsKey :: Text -> Text -> String
itsKey queue key = " with the key " ++ quoted key ++ " in the queue " ++ quoted queue
 where
  quoted = quotedText . Text.unpack

-- | What a function of the schema gives, for a robot's user or the owner.
asRobot :: FromField a => String -> Query -> (Text, Text) -> Behavior a
asRobot at how with = withDatabase at $ \connection -> explained "fleet_robot" $ do
  versions <- query_ connection "select version from fleet.connect(0)"
  mapM_ (throwIO . SchemaFailure) (mapMaybe (unfit . fromOnly) versions)
  query connection how with
    >>= maybe (throwIO (SchemaFailure "the database has given no row")) (pure . fromOnly) . listToMaybe
