-- |
-- A small kit for your own tests: a mock world of scripted actions, conditions,
-- sensors and drivers, a record of what happened in it, and claims about that record.
--
-- > it "goes to its charger before the battery is empty" $ do
-- >   world    <- newMock
-- >   low      <- condition world "battery low" [(0, False), (5, True)]
-- >   tidy     <- action world "tidy up" [succeeds `taking` 30 `slowToStop` 1]
-- >   recharge <- action world "recharge" [succeeds `taking` 20 `causing` set low False]
-- >   simulate (Signal.monitor (signal low) recharge tidy) >>= well
-- >   world `shouldRecord` whenever (becoming "battery low" True) (withinSeconds 2 (startOf "recharge"))
-- >   world `shouldRecord` never (running "tidy up" `overlapping` running "recharge")
--
-- All of it works in a simulation, where waiting costs no real time and every schedule
-- can be tried, and on real threads as well.
--
-- (The names are @taking@ and @comesBefore@, not @after@ and @before@, because hspec
-- exports those.)
module Behavior.Sim.Mock
  ( -- * A world
    Mock
  , newMock
  , begin
  , note

    -- * What the robot does
  , action
  , actionOn
  , Script

    -- ** How it ends
  , succeeds
  , returning
  , fails
  , faults
  , throws
  , hangs

    -- ** How long it takes, and what it changes
  , taking
  , causing

    -- ** What it does when its stop is requested
  , slowToStop
  , failsStopping
  , faultsStopping
  , completesAnyway

    -- * What the robot perceives
  , sensor
  , condition
  , partialCondition
  , Condition
  , signal
  , reading
  , set
  , clear
  , driver

    -- * The record
  , shouldRecord
  , BrokenClaim (..)
  , happened
  , Record (..)
  , RecordEntry (..)
  , EntryKind (..)
  , SubjectKind (..)

    -- * Claims
  , Claim
  , always
  , never
  , eventually
  , withinSeconds
  , comesBefore
  , whenever
  , exactly
  , holds
  , verdict

    -- ** Moments
  , Moment
  , startOf
  , endOf
  , successOf
  , failureOf
  , faultOf
  , interruptionOf
  , becoming
  , noted
  , anyOf
  , during
  , outside
  , overlapping
  , countOf

    -- ** Intervals
  , Interval
  , running
  , being
  , heldFor
  , shortlyAfter
  ) where

import Behavior.Internal.Mock.Action
import Behavior.Internal.Mock.Claim
import Behavior.Internal.Mock.Condition
import Behavior.Internal.Mock.Driver
import Behavior.Internal.Mock.Interval
import Behavior.Internal.Mock.Moment
import Behavior.Internal.Mock.Record
import Behavior.Internal.Mock.Script
import Behavior.Internal.Mock.Subject
import Behavior.Internal.Mock.World
