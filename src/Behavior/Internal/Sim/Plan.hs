{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What to explore, and what comes of it.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Plan
  ( Plan (..)
  , Search (..)
  , randomly
  , exhaustively
  , replaying
  , endingAt
  , Report (..)
  , Counterexample (..)
  , renderSchedule
  ) where

import Control.Exception (Exception, SomeException)
import Data.List (dropWhileEnd, intercalate)

import Behavior.Internal.Seconds (Seconds)
import Behavior.Internal.Sim.Report
import Behavior.Internal.Sim.Types

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Sim

-- | Which schedules to run, and how. Begin with one of 'randomly', 'exhaustively' and
-- 'replaying', and change what should be different:
--
-- >>> let plan = (randomly 1000) {search = Random 1000 7, runOptions = defaults {endAt = 60}}
--
-- @since 0.1.0.0
data Plan = Plan
  { search :: Search
  , runOptions :: Options
  -- ^ Its 'scheduled' is not looked at.
  , showException :: SomeException -> String
  -- ^ How the text of a 'Counterexample' shows what the property threw; by default with
  -- 'Control.Exception.displayException'.
  , selectSteps :: [Step] -> [Step]
  -- ^ Which of its steps that text has; by default all. (See 'ofThreads', 'mentioning'.)
  }

-- | The search under the options, and the defaults.
plan :: Search -> Options -> Plan
plan s o = Plan {search = s, runOptions = o, showException = text, selectSteps = id}

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
  | -- | This one; and if the property fails under it, schedules with fewer pre-emptions, to
    -- find one under which it also fails.
    Shrink Schedule
  deriving (Eq, Show)

-- | So many random schedules: each has few pre-emptions or many, but mostly few.
--
-- The seed is 0: another one tries other schedules.
--
-- >>> search (randomly 1000)
-- Random 1000 0
--
-- @since 0.1.0.0
randomly :: Int -> Plan
randomly n = plan (Random n 0) defaults

-- | All schedules with up to so many pre-emptions, if there are no more than a million:
-- for small behaviours. (To go on with another thread where one has to wait is no
-- pre-emption: such choices are all made.)
--
-- @since 0.1.0.0
exhaustively :: Int -> Plan
exhaustively k = plan (Exhaustive k 1000000) defaults

-- | Only this schedule, told in detail: what a 'Counterexample' says, to see it again.
--
-- @since 0.1.0.0
replaying :: Schedule -> Plan
replaying s = plan (Replay s) defaults {detailed = True}

-- | The same schedules, with an end: every run is stopped when the virtual time comes to
-- this ('endAt'), with 'OutOfTime'. For missions that have no end of their own.
--
-- >>> import Control.Monad (forever)
-- >>> report <- explore (randomly 100 `endingAt` 60) (\simulate -> () <$ simulate (forever (sleep 1)))
-- >>> schedules report
-- 100
--
-- @since 0.1.0.0
endingAt :: Plan -> Seconds -> Plan
endingAt whole end = whole {runOptions = (runOptions whole) {endAt = end}}

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
  , reason :: SomeException
  -- ^ What the property threw.
  , failingSteps :: [Step]
  -- ^ What happened, in detail.
  , schedulesTried :: Int
  -- ^ How many schedules were run until one failed.
  , foundBy :: Plan
  -- ^ How it was found, and how its text shows it.
  }

instance Show Counterexample where
  show c =
    intercalate
      "\n"
      [ "schedule " ++ show (schedulesTried c) ++ " fails:"
      , indented (showException (foundBy c) (reason c))
      , renderSchedule c
      ]
   where
    indented = intercalate "\n" . map ("  " ++) . lines

instance Exception Counterexample

-- | The text of a counterexample without what the property threw: the schedule, what
-- happened, and how to replay it.
--
-- >>> found <- tryExplore (exhaustively 1) (\simulate -> simulate (sleep 1) >> fail "always")
-- >>> either (putStrLn . renderSchedule) print found
-- shrunk to the undisturbed schedule, this happens:
--      0.000 s  0 main  sleeps until 1.000 s
-- to see it again: explore (replaying (Preempting []))
--
-- @since 0.1.0.0
renderSchedule :: Counterexample -> String
renderSchedule c =
  intercalate
    "\n"
    [ schedule' ++ ", this happens" ++ omission ++ ":"
    , dropWhileEnd (== '\n') (renderSteps selected)
    , "to see it again: explore (replaying (" ++ show (failing c) ++ "))"
    ]
 where
  selected = selectSteps (foundBy c) (failingSteps c)
  omission
    | length selected == length (failingSteps c) = ""
    | otherwise = " (" ++ show (length selected) ++ " of " ++ show (length (failingSteps c)) ++ " steps)"
  schedule' = case failing c of
    Preempting [] -> "shrunk to the undisturbed schedule"
    Preempting [_] -> "shrunk to one switch"
    Preempting several -> "shrunk to " ++ show (length several) ++ " switches"
    other -> "under the schedule " ++ show other
