{-# OPTIONS_HADDOCK not-home #-}

-- |
-- One test of a property, under one schedule; and the sums of many tests.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Trial
  ( Trial (..)
  , tryRun

    -- * Many
  , Tally
  , noTrials
  , counting
  , reported
  ) where

import Control.Exception hiding (Deadlock)
import Data.IORef
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (fromMaybe)

import Behavior.Internal.Core.Failure (Behavior, isCancellation)
import Behavior.Internal.Core.Property
import Behavior.Internal.Sim.Coverage
import Behavior.Internal.Sim.Plan
import Behavior.Internal.Sim.Policy
import Behavior.Internal.Sim.Report
import Behavior.Internal.Sim.Simulate
import Behavior.Internal.Sim.Types
import Behavior.Internal.Spans.Event (Event)

-- | One run of the property: its exception, and the simulated run.
data Trial = Trial
  { thrown :: Maybe SomeException
  , otherEnd :: Maybe String
  -- ^ How the run ended, if it did not return a result.
  , deviations :: [(Int, Int)]
  -- ^ The choices that deviate from the non-preemptive schedule.
  , happened :: [Step]
  , traceOfRun :: [Event]
  , size :: Int
  , reached :: Reached
  -- ^ What it could start, and what of that it has started.
  , claimed :: Map String Bool
  -- ^ The premises of its claims, and whether each has come.
  }

-- | A trial that has not run anything.
noTrial :: Trial
noTrial =
  Trial
    { thrown = Nothing
    , otherEnd = Nothing
    , deviations = []
    , happened = []
    , traceOfRun = []
    , size = 0
    , reached = nothingYet
    , claimed = Map.empty
    }

-- | Runs the property once.
tryRun :: SimOptions -> IO Policy -> ((Behavior a -> IO (Run a)) -> IO ()) -> IO Trial
tryRun o choosing property = testing $ \this -> do
  made <- newIORef Nothing
  let simulating act = do
        before <- readIORef made
        case before of
          Just _ -> mistake "explore: a property simulates only once"
          Nothing -> do
            chooser <- choosing
            (run, startable) <- simulateBy o (Just this) chooser act
            let deviating = case runSchedule run of
                  Preempting s -> s
                  _ -> []
            writeIORef made . Just $
              noTrial
                { otherEnd = otherEndOf (outcome run)
                , deviations = deviating
                , happened = steps run
                , traceOfRun = events run
                , size = runPoints run
                , reached = startable
                }
            case outcome run of
              BlockedOutside _ _ -> improper run
              ExternalWakeup _ -> improper run
              TooSlow _ _ -> improper run
              ScheduleMismatch _ -> improper run
              _ -> run <$ throwMistake
      improper run = mistake (explain (outcome run))
      mistake why = keepMistake this (ErrorCall why) >> throwIO (ErrorCall why)
      throwMistake = mistakeOf this >>= mapM_ throwIO
  end <- try ((property simulating >>= evaluate) <* throwMistake)
  trial <- readIORef made
  presupposed <- premisesOf this
  case (end, trial) of
    (Right (), Just simulated) -> pure simulated {claimed = presupposed}
    (Right (), Nothing) -> throwIO . ErrorCall $
      "explore: the property has simulated nothing, so it shows nothing: \
      \it is given a function, and has to simulate with it"
    (Left e, _)
      | isCancellation e -> throwIO e
      | otherwise -> pure (fromMaybe noTrial trial) {thrown = Just e}

-- | The trials so far.
data Tally = Tally
  { tried :: !Int
  , points :: !Int
  , otherEnds :: !(Map String Int)
  -- ^ How those trials ended that did not return a result.
  , covered :: !Coverage
  }

-- | None yet.
noTrials :: Tally
noTrials = Tally {tried = 0, points = 0, otherEnds = Map.empty, covered = noCoverage}

-- | With a further one.
counting :: Tally -> Trial -> Tally
counting before t =
  Tally
    { tried = tried before + 1
    , points = points before + size t
    , otherEnds = maybe id (\end -> Map.insertWith (+) end 1) (otherEnd t) (otherEnds before)
    , covered = withRun (traceOfRun t) (reached t) (claimed t) (covered before)
    }

-- | The report, given whether these are all schedules of the plan.
reported :: Bool -> Tally -> Report
reported complete these =
  Report
    { reportSchedules = tried these
    , reportComplete = complete
    , reportPoints = points these
    , reportEnds = Map.toList (otherEnds these)
    , reportStarted = started (covered these)
    , reportNeverStarted = neverStarted (covered these)
    , reportNeverCame = neverCame (covered these)
    }
