{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Which schedules to explore, and the results.
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

import Behavior.Internal.Core.Seconds (Seconds)
import Behavior.Internal.Sim.Report
import Behavior.Internal.Sim.Types
import Behavior.Internal.Spans.Event (Event)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Sim

-- | Which schedules to run, and how. Begin with one of 'randomly', 'exhaustively' and
-- 'replaying', and change some of its fields:
--
-- >>> let plan = (randomly 1000) {planSearch = Random 1000 7, planOptions = defaultSimOptions {endAt = 60}}
--
-- @since 0.1.0.0
data Plan = Plan
  { planSearch :: Search
  , planOptions :: SimOptions
  -- ^ The field 'scheduled' is ignored.
  , planShowException :: SomeException -> String
  -- ^ How the text of a 'Counterexample' shows the property's exception; by default with
  -- 'Control.Exception.displayException'.
  , planSelectSteps :: [Step] -> [Step]
  -- ^ The steps that this text shows; by default all. (See 'ofThreads', 'mentioning'.)
  }

-- | A plan with the default text.
plan :: Search -> SimOptions -> Plan
plan s o = Plan {planSearch = s, planOptions = o, planShowException = text, planSelectSteps = id}

-- | Which schedules to run.
--
-- @since 0.1.0.0
data Search
  = -- | The given number of random ones, from the given seed. Each has few pre-emptions or many.
    Random Int Int
  | -- | All with up to the given number of pre-emptions, but not more schedules than the second
    -- number.
    Exhaustive Int Int
  | -- | This one.
    Replay Schedule
  | -- | This one; and if the property fails under it, schedules with fewer pre-emptions, to
    -- find one under which it fails too.
    Shrink Schedule
  deriving (Eq, Show)

-- | The given number of random schedules. Each has few pre-emptions or many, but mostly few.
--
-- The seed is 0. Another seed tries other schedules.
--
-- >>> planSearch (randomly 1000)
-- Random 1000 0
--
-- @since 0.1.0.0
randomly :: Int -> Plan
randomly n = plan (Random n 0) defaultSimOptions

-- | All schedules with up to the given number of pre-emptions, but at most a million schedules:
-- for small behaviours. (Where the running thread has to wait, the choice of the next thread is
-- not counted as a pre-emption: every enabled thread is tried there.)
--
-- @since 0.1.0.0
exhaustively :: Int -> Plan
exhaustively k = plan (Exhaustive k 1000000) defaultSimOptions

-- | Only this schedule, with detailed steps: to replay a 'Counterexample'.
--
-- @since 0.1.0.0
replaying :: Schedule -> Plan
replaying s = plan (Replay s) defaultSimOptions {detailedSteps = True}

-- | The same plan with an end: every run is ended with 'OutOfTime' when the virtual time
-- reaches this ('endAt'). For missions that do not end by themselves. (A mission in which nothing can run any
-- more ends with a 'Deadlock' all the same; if it may wait like that, write @mission ||| sleep 60@.)
--
-- >>> import Control.Monad (forever)
-- >>> report <- explore (randomly 100 `endingAt` 60) (\simulate -> () <$ simulate (forever (sleep 1)))
-- >>> reportSchedules report
-- 100
--
-- @since 0.1.0.0
endingAt :: Plan -> Seconds -> Plan
endingAt whole end = whole {planOptions = (planOptions whole) {endAt = end}}

-- | What was explored. Its text has the numbers; how those runs have ended that did not return; and what
-- no schedule has started, or has brought about.
--
-- @since 0.1.0.0
data Report = Report
  { reportSchedules :: !Int
  -- ^ How many schedules were run.
  , reportComplete :: !Bool
  -- ^ Whether those were all schedules of the plan.
  , reportPoints :: !Int
  -- ^ How many scheduling points they had, in all.
  , reportEnds :: [(String, Int)]
  -- ^ How many runs have ended in other ways than by returning a result: @("faulted", 20)@. (What a property does
  -- not look at does not fail it: see 'Behavior.Sim.well'.)
  , reportStarted :: [String]
  -- ^ The names of what was started under at least one schedule: behaviours that have a name
  -- ('Behavior.Trace.named'), scripted actions, and branches, as in @"monitor: recovery"@ or
  -- @"teleoReactive: rule 2"@. Require those without which the property shows nothing.
  , reportNeverStarted :: [String]
  -- ^ What no schedule has started, as far as it is known what could be: scripted actions of mock worlds, and
  -- branches of reactive operators that some schedule has begun (rules, recoveries, handlers...), as in
  -- @"monitor: recovery"@. A branch is followed by the names of the behaviours around its operator
  -- ('Behavior.Trace.named'), as in @"teleoReactive: rule 2 (mission > way home)"@: operators of the same kind
  -- with the same names around them count as one. (The branches of 'Behavior.Signal.switch' are not known
  -- before; an alternative of '?' is no branch: name it, and require it in 'reportStarted'.)
  , reportNeverCame :: [String]
  -- ^ What came under no schedule, and without which a claim of 'Behavior.Sim.Mock.shouldRecord' holds whatever
  -- the robot does: the first moment of a 'Behavior.Sim.Mock.whenever', the second of a
  -- 'Behavior.Sim.Mock.comesBefore', and the intervals of a 'Behavior.Sim.Mock.never' with
  -- 'Behavior.Sim.Mock.during' or 'Behavior.Sim.Mock.overlapping'.
  }
  deriving (Eq)

instance Show Report where
  show r =
    counted "schedule" (reportSchedules r) ++ " of " ++ counted "point" (reportPoints r) ++ " in all"
      ++ (if reportComplete r then "" else ", and there are more")
      ++ listed "; " [show n ++ " " ++ end | (end, n) <- reportEnds r]
      ++ listed "; never started: " (map show (reportNeverStarted r))
      ++ listed "; never came: " (reportNeverCame r)
   where
    counted what n = show n ++ " " ++ what ++ (if n == 1 then "" else "s")
    listed title those = if null those then "" else title ++ intercalate ", " those

-- | A schedule under which the property does not hold.
--
-- Its text shows the property's exception, the steps of the run, and how to replay it.
--
-- @since 0.1.0.0
data Counterexample = Counterexample
  { failingSchedule :: Schedule
  , failingException :: SomeException
  -- ^ The exception that the property threw.
  , failingSteps :: [Step]
  -- ^ The detailed steps.
  , failingEvents :: [Event]
  -- ^ The events of the run's trace.
  , schedulesTried :: Int
  -- ^ How many schedules were run until one failed.
  , foundBy :: Plan
  -- ^ The plan that found it, and that determines its text.
  }

instance Show Counterexample where
  show c =
    intercalate
      "\n"
      [ "schedule " ++ show (schedulesTried c) ++ " fails:"
      , indented (planShowException (foundBy c) (failingException c))
      , renderSchedule c
      ]
   where
    indented = intercalate "\n" . map ("  " ++) . lines

instance Exception Counterexample

-- | The text of a counterexample without the property's exception: the schedule, the steps,
-- and how to replay it.
--
-- >>> found <- tryExplore (exhaustively 1) (\simulate -> simulate (sleep 1) >> fail "always")
-- >>> either (putStrLn . renderSchedule) print found
-- shrunk to the non-preemptive schedule, this happens:
--      0.000 s  0 main  sleeps until 1.000 s
-- to see it again: explore (replaying (Preempting []))
--
-- @since 0.1.0.0
renderSchedule :: Counterexample -> String
renderSchedule c =
  intercalate
    "\n"
    [ preempted ++ ", this happens" ++ omission ++ ":"
    , dropWhileEnd (== '\n') (renderSteps selected)
    , "to see it again: explore (replaying (" ++ show (failingSchedule c) ++ "))"
    ]
 where
  selected = planSelectSteps (foundBy c) (failingSteps c)
  omission
    | length selected == length (failingSteps c) = ""
    | otherwise = " (" ++ show (length selected) ++ " of " ++ show (length (failingSteps c)) ++ " steps)"
  preempted = case failingSchedule c of
    Preempting [] -> "shrunk to the non-preemptive schedule"
    Preempting [_] -> "shrunk to one pre-emption"
    Preempting several -> "shrunk to " ++ show (length several) ++ " pre-emptions"
    other -> "under the schedule " ++ show other
