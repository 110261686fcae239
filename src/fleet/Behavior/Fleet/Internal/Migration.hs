{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The schema of a fleet's database is created, and migrated: each of that in one transaction, and one at a time.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Migration
  ( SchemaFailure (..)
  , createSchema
  , migrateSchema
  , newEpoch

    -- * For the tool, and for tests
  , migrateFurther
  , withDatabase
  ) where

import Control.Exception
import Control.Monad (unless, void, when)
import Data.ByteString (ByteString)
import qualified Data.ByteString.Char8 as Bytes
import Data.Foldable (for_)
import Data.Maybe (listToMaybe)
import Data.Text (Text)
import qualified Data.Text as Text
import Database.PostgreSQL.Simple
import Database.PostgreSQL.Simple.FromField (FromField)
import Database.PostgreSQL.Simple.Types (PGArray (..), Query (..))
import Text.Read (readMaybe)

import Behavior (Behavior, Seconds, behaviorFailedFromException, behaviorFailedToException)
import Behavior.Fleet.Internal.Connect
import Behavior.Fleet.Internal.Error (ConnectionLost (..))
import Behavior.Fleet.Internal.Schema (rights, versions)
import Behavior.Fleet.Internal.Version

-- | Why it was not done, and what is to be done first. A failure: 'Behavior.?' catches it.
--
-- @since 0.1.0.0
newtype SchemaFailure = SchemaFailure String
  deriving (Eq, Show)

instance Exception SchemaFailure where
  toException = behaviorFailedToException
  fromException = behaviorFailedFromException
  displayException (SchemaFailure why) = why

-- | Creates the schema in the database at this address (as of 'Behavior.Fleet.postgres'), and the roles @fleet_robot@
-- and @fleet_viewer@, if they are missing.
--
-- It is done in one transaction: all of it, or nothing. The user needs the right to create schemas in the database
-- and, if these are missing, roles.
--
-- > createSchema "dbname=fleet user=owner"
--
-- [Result] None.
-- [Failure] 'SchemaFailure': there is a schema @fleet@ already, a right is missing, or the database is not there.
-- [Cancellation] Then the schema is not created. (If the stop comes together with the end, it may be.)
--
-- @since 0.1.0.0
createSchema :: String -> Behavior ()
createSchema address = withDatabase address $ \connection -> alone connection $ do
  found connection >>= \case
    Nothing -> pure ()
    Just version ->
      refuse $ "there is a fleet in this database already, and its schema has version " ++ show version
        ++ case compare version newest of
          LT -> ": run behavior-fleet migrate"
          EQ -> ", the newest: nothing is to be done (if roles or rights are missing, run behavior-fleet migrate)"
          GT -> ", which is newer than version " ++ show newest ++ " of this program: it needs a newer behavior-lang"
  requireRights connection
  bringTo versions connection 0

-- | Brings the schema of the database at this address to the version of this library, in one transaction: gives the
-- version that it had, and the one that it has. Its roles and rights are there then, too: a dump that is restored on
-- another server lacks them.
--
-- The user needs to be the owner of the schema, and the right to create roles, if these are missing.
--
-- [Result] The two versions.
-- [Failure] 'SchemaFailure': there is no fleet, its schema is newer than this library, the schema @fleet@ is not one of
--   this library, a right is missing, or the database is not there.
-- [Cancellation] Then nothing is changed. (If the stop comes together with the end, all of it may be.)
--
-- @since 0.1.0.0
migrateSchema :: String -> Behavior (Int, Int)
migrateSchema = migrateFurther []

-- | 'migrateSchema', to the last of these versions that come after the newest.
migrateFurther :: [ByteString] -> String -> Behavior (Int, Int)
migrateFurther further address = withDatabase address $ \connection -> alone connection $ do
  version <- found connection >>= maybe (refuse noFleet) pure
  when (version > length known) (mapM_ refuse (unfit version))
  (version, length known) <$ bringTo known connection version
 where
  known = versions ++ further

-- | To be called after the database at this address was restored from a copy, when none of the robots that used the
-- other one runs: no start of a task runs in it, and no number of a task, lease or fence is given out again. No
-- resource is free before that term is over (of 0 s to a day), or the longest one that the database knows: robots that
-- were stopped may have held one. Gives the number of the new epoch. Then robots may be started.
--
-- The user needs to be the owner of the schema.
--
-- [Result] The new epoch.
-- [Failure] 'SchemaFailure', as 'migrateSchema', and for a term that is not allowed.
-- [Cancellation] Then there is no new epoch. (If the stop comes together with the end, there may be.)
--
-- @since 0.1.0.0
newEpoch :: Seconds -> String -> Behavior Int
newEpoch term address = withDatabase address $ \connection -> alone connection $ do
  version <- found connection >>= maybe (refuse noFleet) pure
  for_ (unfit version) refuse
  unless (term >= 0 && term <= 86400) $ refuse ("a term has 0 seconds to 1 day, and not " ++ show term ++ " s")
  query connection "select fleet.new_epoch(? * interval '1 s')" (Only (realToFrac term :: Double))
    >>= maybe (refuse "the database has given no row") (pure . fromOnly) . listToMaybe

refuse :: String -> IO a
refuse = throwIO . SchemaFailure

-- | Runs this with a connection of its own. What is wrong with the database is a 'SchemaFailure'.
withDatabase :: String -> (Connection -> Behavior a) -> Behavior a
withDatabase address act = bracket (connected 5 address) close act `catches` [Handler away, Handler refused]
 where
  away why = refuse ("there is no connection to the database: " ++ whyLost why)
  refused e
    | sqlState e == "55P03" = refuse "another program works on this schema, or uses it: try again"
    | otherwise = refuse ("the database refuses it: " ++ Text.unpack (text (sqlErrorMsg e)))

-- | In one transaction (which ends with the connection, if this throws). No other program creates or migrates
-- meanwhile, or begins a new epoch.
alone :: Connection -> IO a -> IO a
alone connection act = losing $ do
  -- (Names mean what PostgreSQL means by them, whatever is in other schemas.)
  run connection "begin isolation level read committed read write"
  run connection "set local search_path = pg_catalog, pg_temp; set local lock_timeout = '10s'"
  -- (The number is arbitrary: another program's lock is unlikely to have it.)
  void (query_ connection "select pg_advisory_xact_lock(7310579634563)::text" :: IO [Only Text])
  a <- act
  a <$ run connection "commit"

-- | The version of the schema, if there is one. Refuses a schema that is not one of this library, or not whole.
found :: Connection -> IO (Maybe Int)
found connection = do
  owners <- query_ connection
    "select pg_has_role(nspowner, 'usage'), quote_ident(pg_get_userbyid(nspowner)) from pg_namespace \
    \where nspname = 'fleet'"
  case owners of
    [] -> pure Nothing
    (False, owner) : _ ->
      refuse ("the schema fleet of this database belongs to the role " ++ owner ++ ": run this as that role")
    (True, _) : _ -> Just <$> version
 where
  version = do
    isOurs <- one connection
      "select exists (select from pg_attribute where attrelid = to_regclass('fleet.about') and attname = 'version')"
    unless isOurs (refuse damaged)
    rows <- query_ connection "select version::text from fleet.about"
    case [v | Only (Just it) <- rows, Just v <- [readMaybe it]] of
      [v] | length rows == 1, v >= 1 -> v <$ requireWhole connection v
      _ -> refuse damaged
  damaged =
    "the schema fleet of this database is not one that behavior-fleet has created, or it is damaged (it does not say \
    \its version): use another database, or restore this one from a copy"

-- | Refuses a schema of this version in which something is missing.
requireWhole :: Connection -> Int -> IO ()
requireWhole connection version = do
  missing <- query connection
    "select distinct name from unnest(?::text[]) name where to_regclass(name) is null and to_regtype(name) is null \
    \and not exists (select from pg_proc where pronamespace = to_regnamespace('fleet') and 'fleet.' || proname = name)"
    (Only (PGArray (concatMap (partsOf . text) (take version versions))))
  unless (null missing) . refuse $
    "the schema fleet of this database is damaged: of version " ++ show version ++ " it lacks "
      ++ unwords [Text.unpack name | Only name <- missing] ++ ": restore the database from a copy"

-- | What this script creates.
partsOf :: Text -> [Text]
partsOf script =
  [ name
  | "create" : rest <- map Text.words (Text.lines script)
  , name : _ <- [[Text.takeWhile (`notElem` ("(;" :: String)) word | word <- rest, "fleet." `Text.isPrefixOf` word]]
  ]

requireRights :: Connection -> IO ()
requireRights connection = do
  server <- one connection "select current_setting('server_version_num')::int"
  when (server < (150000 :: Int)) $
    refuse ("this server is PostgreSQL " ++ show (server `div` 10000) ++ ", and a fleet needs 15, or a newer one")
  (mayCreate, database, me) <- row connection
    "select has_database_privilege(current_database(), 'create'), quote_ident(current_database()), \
    \quote_ident(current_user)"
  unless mayCreate . refuse $
    "the role " ++ me ++ " may not create a schema in this database: run, as the database's owner or a superuser, \
      \grant create on database " ++ database ++ " to " ++ me

-- | The roles, if they are missing.
createRoles :: Connection -> IO ()
createRoles connection = do
  (mayCreateRoles, me) <- row connection
    "select rolcreaterole or rolsuper, quote_ident(current_user) from pg_roles where rolname = current_user"
  missing <- query connection "select name from unnest(?::text[]) name where to_regrole(name) is null"
    (Only (PGArray (map Bytes.unpack roles)))
  unless (mayCreateRoles || null missing) . refuse $
    "the role " ++ me ++ " may not create roles: run, as a superuser,"
      ++ concat [" create role " ++ name ++ " nologin;" | Only name <- missing]
  for_ roles $ \role ->
    -- (The roles are those of all databases of a server: another one may create them at the same time.)
    run connection $ mconcat
      [ "do $$ begin if to_regrole('", role, "') is null then create role ", role, " nologin; end if; "
      , "exception when duplicate_object or unique_violation then null; end $$"
      ]

roles :: [ByteString]
roles = ["fleet_robot", "fleet_viewer"]

-- | Brings the schema from that version to the last of these, with its roles and rights.
bringTo :: [ByteString] -> Connection -> Int -> IO ()
bringTo known connection from = do
  createRoles connection
  for_ (drop from (zip [1 ..] known)) $ \(version, script) ->
    run connection (script <> "\n; update fleet.about set version = " <> Bytes.pack (show (version :: Int)))
  run connection rights

run :: Connection -> ByteString -> IO ()
run connection = void . execute_ connection . Query

one :: FromField a => Connection -> Query -> IO a
one connection = fmap fromOnly . row connection

row :: FromRow a => Connection -> Query -> IO a
row connection how = query_ connection how >>= maybe (refuse "the database has given no row") pure . listToMaybe
