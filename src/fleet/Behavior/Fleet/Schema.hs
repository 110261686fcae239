-- |
-- The schema of a fleet's database: what the program @behavior-fleet@ does with it, for programs and tests.
--
-- A database has one fleet, in the schema @fleet@, which belongs to the user that has created it. The users of robots
-- are in the role @fleet_robot@: they call the functions of the schema, and have no right to its tables. Those that
-- only look are in @fleet_viewer@: they read its views. (A copy by @pg_dump@ has no roles: on another server they are
-- created before it is restored.)
--
-- > behavior-fleet create "dbname=fleet user=owner"
-- > psql fleet -c 'create role robots login in role fleet_robot'
module Behavior.Fleet.Schema
  ( createSchema
  , migrateSchema
  , newEpoch
  , SchemaFailure (..)
  ) where

import Behavior.Fleet.Internal.Migration
