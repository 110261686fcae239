-- |
-- Simulation: what a robot does at the one bad moment, tried out.
module Behavior.Sim
  ( -- * One run
    simulate
  , simulateWith
  , Options (..)
  , defaults
  , Schedule (..)

    -- * What came of it
  , Run (..)
  , Outcome (..)
  , explain
  , Waiting (..)
  , Blocked (..)
  , Step (..)
  , Did (..)
  , Label (..)
  , narrate

    -- * Many runs
  , explore
  , exploring
  , Plan (..)
  , Search (..)
  , randomly
  , exhaustively
  , replaying
  , Report (..)
  , Counterexample (..)
  ) where

import Behavior.Internal.Seam (Label (..))
import Behavior.Internal.Sim.Explore
import Behavior.Internal.Sim.Report
import Behavior.Internal.Sim.Simulate
import Behavior.Internal.Sim.Types
