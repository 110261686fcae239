-- |
-- Fleets: many robots on many machines, which die, share tasks and resources through one PostgreSQL database (15 or
-- later).
--
-- > orders = queue "orders" :: Queue Order ()
-- >
-- > main = runBehavior . withFleet (postgres "dbname=fleet") (Robot "amy" ["lift"]) $ \fleet ->
-- >   serving fleet orders $ \order -> do
-- >     holding fleet (resource "north door") 3 (passThrough order)
-- >     carry order
-- >     pure (writing (\connection -> delivered connection order))
--
-- A task is started at least once, and completed exactly once, with what the robot writes ('serving'). A resource is
-- held by one robot at a time, with a fence for when that cannot be kept ('holding'). The contract is the schema: its
-- SQL functions, which other programs call, too. The program @behavior-fleet@ creates it ("Behavior.Fleet.Schema").
--
-- "Behavior.Fleet.Fake" is a database for tests and simulations.
module Behavior.Fleet
  ( -- * A robot in its fleet
    Fleet
  , Robot (..)
  , withFleet
  , withRobot
  , fleetRobot
  , databaseUp

    -- * The database
  , Database
  , postgres

    -- * What can be set
  , withFleetOptions
  , FleetOptions (..)
  , defaultFleetOptions

    -- * Tasks
  , Queue
  , queue
  , submit
  , submitWith
  , SubmitOptions (..)
  , defaultSubmitOptions
  , Ticket
  , findTask
  , watchingTask
  , waitForTask
  , Task (..)
  , TaskState (..)
  , cancelTask
  , retryTask
  , deadTasks

    -- * Serving
  , serving
  , servingWith
  , Work (..)
  , Commit
  , writing
  , instead

    -- * Resources
  , Resource
  , resource
  , holding
  , holdingWithin
  , holdingAll
  , Fence
  , fenceNumber
  , isLeaseLost

    -- * What goes wrong
  , FleetFailure (..)
  , FleetFault (..)
  ) where

import Behavior.Fleet.Internal.Commit
import Behavior.Fleet.Internal.Contract (Task (..), TaskState (..))
import Behavior.Fleet.Internal.Database
import Behavior.Fleet.Internal.Error
import Behavior.Fleet.Internal.Fleet
import Behavior.Fleet.Internal.Keeper
import Behavior.Fleet.Internal.Options
import Behavior.Fleet.Internal.Postgres
import Behavior.Fleet.Internal.Resource
import Behavior.Fleet.Internal.Serving
import Behavior.Fleet.Internal.Task
