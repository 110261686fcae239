{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What the runs of an exploration have started, and what they have not.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Coverage
  ( Coverage
  , nothing
  , withRun
  , started
  , neverStarted
  ) where

import Data.List (foldl', isPrefixOf)
import Data.Set (Set)
import qualified Data.Set as Set

import Behavior.Internal.Trace.Event

-- | The names of what was started, and of the scripted actions.
data Coverage = Coverage !(Set String) !(Set String)

-- | That of no run.
nothing :: Coverage
nothing = Coverage Set.empty Set.empty

-- | With that of a further run.
withRun :: [Event] -> [String] -> Coverage -> Coverage
withRun happened actions (Coverage known scripted) =
  Coverage (foldl' add known [spanName s | Began s <- happened, spanKind s /= Operator]) (foldl' add scripted actions)
 where
  -- A name is evaluated, so that it does not keep its run in memory.
  add names name
    | Set.member name names = names
    | otherwise = length name `seq` Set.insert name names

-- | The names of all that was started: behaviours that have a name, scripted actions, and branches.
started :: Coverage -> [String]
started (Coverage known _) = Set.toAscList known

-- | The names of the scripted actions that no run has started, with no argument if they have one.
neverStarted :: Coverage -> [String]
neverStarted (Coverage known scripted) = filter (not . wasStarted) (Set.toAscList scripted)
 where
  wasStarted name = Set.member name known || any ((name ++ " ") `isPrefixOf`) (Set.lookupGT name known)
