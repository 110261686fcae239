{-# LANGUAGE LambdaCase #-}

-- |
-- What to explore, and what comes of it.
module Behavior.Internal.Sim.Plan
  ( Plan (..)
  , Search (..)
  , randomly
  , exhaustively
  , replaying
  , Report (..)
  , Counterexample (..)
  ) where

import Control.Exception (Exception, SomeException)
import Data.List (dropWhileEnd, intercalate)

import Behavior.Internal.Sim.Report
import Behavior.Internal.Sim.Types

-- | Which schedules to run, and how.
--
-- @since 0.1.0.0
data Plan = Plan
  { search :: Search
  , under :: Options
  -- ^ Its 'scheduled' is not looked at.
  }

-- | Which schedules to run.
--
-- @since 0.1.0.0
data Search
  = -- | So many random ones, from this seed. Each has few pre-emptions or many.
    Random Int Int
  | -- | All with up to so many pre-emptions; but no more schedules than the second number.
    Exhaustive Int Int
  | -- | This one.
    Replay Schedule
  deriving (Eq, Show)

-- | So many random schedules: each has few pre-emptions or many, but mostly few.
--
-- > randomly n  =  Plan (Random n 0) defaults
--
-- @since 0.1.0.0
randomly :: Int -> Plan
randomly n = Plan (Random n 0) defaults

-- | All schedules with up to so many pre-emptions, if there are no more than a million:
-- for small behaviours. (To go on with another thread where one has to wait is no
-- pre-emption: such choices are all made.)
--
-- @since 0.1.0.0
exhaustively :: Int -> Plan
exhaustively k = Plan (Exhaustive k 1000000) defaults

-- | Only this schedule, told in detail: what a 'Counterexample' says, to see it again.
--
-- @since 0.1.0.0
replaying :: Schedule -> Plan
replaying s = Plan (Replay s) defaults {detailed = True}

-- | What was explored.
--
-- @since 0.1.0.0
data Report = Report
  { schedules :: !Int
  -- ^ How many schedules were run.
  , complete :: !Bool
  -- ^ Whether those were all that the plan asks for.
  , pointsInAll :: !Int
  -- ^ How many scheduling points they had.
  }
  deriving (Eq)

instance Show Report where
  show r =
    show (schedules r) ++ " schedules of " ++ show (pointsInAll r) ++ " points in all"
      ++ (if complete r then "" else ", and there are more")

-- | A schedule under which the property does not hold.
--
-- Its text says what went wrong, what happened up to then, and how to replay it.
--
-- @since 0.1.0.0
data Counterexample = Counterexample
  { failing :: Schedule
  , because :: SomeException
  -- ^ What the property threw.
  , story :: [Step]
  -- ^ What happened, in detail.
  , foundAfter :: Int
  -- ^ How many schedules were run until one failed.
  }

instance Show Counterexample where
  show c =
    intercalate
      "\n"
      [ "schedule " ++ show (foundAfter c) ++ " fails:"
      , indented (text (because c))
      , "shrunk to " ++ counted (failing c) ++ ", this happens:"
      , dropWhileEnd (== '\n') (narrate (story c))
      , "to see it again: explore (replaying (" ++ show (failing c) ++ "))"
      ]
   where
    indented = intercalate "\n" . map ("  " ++) . lines
    counted = \case
      Switching [] -> "the undisturbed schedule"
      Switching [_] -> "one switch"
      Switching several -> show (length several) ++ " switches"
      other -> show other

instance Exception Counterexample
