{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE RankNTypes #-}

-- |
-- A database, as a fleet uses it: PostgreSQL, or in a simulation a fake.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Database
  ( Database (..)
  , Session (..)
  ) where

import Data.Aeson (Value)
import Data.UUID.Types (UUID)

import Behavior (Behavior, Seconds)
import Behavior.Fleet.Internal.Commit
import Behavior.Fleet.Internal.Contract

-- | A database: made by 'Behavior.Fleet.postgres', or by 'Behavior.Fleet.Fake.fakeDatabase' for tests.
--
-- @since 0.1.0.0
data Database = Database
  { databaseName :: String
  -- ^ For the texts of errors.
  , newUnique :: Behavior UUID
  , ownClock :: Behavior Seconds
  -- ^ The clock by which a robot judges its own leases. It goes on while the machine is suspended, and never jumps.
  , opening :: forall a. Seconds -> (Session -> Behavior a) -> Behavior a
  -- ^ Connects, and runs the behaviour while it is connected. Each server of the address has that many seconds to
  -- answer (if the address has no limit of its own).
  }

-- | A connection. One behaviour at a time may use it (but for 'awaitNews'). Each of these throws
-- 'Behavior.Fleet.Internal.Error.ConnectionLost' when it is lost; after any exception it must not be used again.
data Session = Session
  { ask :: forall r. Request r -> Behavior (Either Refusal r)
  , commit :: forall o. TaskNumber -> Number -> (o -> Value) -> Commit o -> Behavior (Either Refusal o)
  -- ^ Completes the task with what is written, in one transaction.
  , listen :: Behavior ()
  -- ^ From now on notices come.
  , awaitNews :: Behavior ()
  -- ^ Waits until there may be notices.
  , takeNews :: Behavior [Notice]
  -- ^ The notices that have come. It does not wait.
  }
