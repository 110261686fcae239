{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE BangPatterns #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Many schedules of one behaviour.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Explore
  ( explore
  , tryExplore
  ) where

import Control.Exception hiding (Deadlock)
import Data.Foldable (toList, traverse_)
import Data.IORef
import Data.Maybe (fromMaybe)
import qualified Data.Sequence as Seq

import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Sim.Plan
import Behavior.Internal.Sim.Policy
import Behavior.Internal.Sim.Prefix
import Behavior.Internal.Sim.Trial
import Behavior.Internal.Sim.Types

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Sim

-- | An exception that the property threw once, but not when the same schedule was run again.
newtype Unrepeatable = Unrepeatable String

instance Show Unrepeatable where
  show (Unrepeatable e) =
    e
      ++ "\nBut when the same schedule was run again, this did not happen. Something in it is not simulated: \
         \a clock, a random number, a thread of forkIO, what an earlier run left behind?"

instance Exception Unrepeatable

-- | Runs a property under many schedules, until one fails.
--
-- The property is given a function that simulates a behaviour, as 'simulateWith' does, under
-- the schedule that is tried. The property creates the state that it needs, simulates once, and
-- throws if something is wrong, as the expectations of test libraries do.
--
-- [Result] A 'Report', if the property held under every schedule.
-- [Failure] Otherwise a 'Counterexample' is thrown, whose schedule was shrunk to few
--   pre-emptions. 'replaying' runs it again.
-- [Fault] If a run is not a valid simulation ('BlockedOutside', 'ExternalWakeup', 'TooSlow',
--   'ScheduleMismatch'), an 'ErrorCall' with the text of 'explain' is thrown to the property; and also if a
--   mock world was used that belongs to another run. A property that catches it fails all the same.
--   Where nothing would be tested, an 'ErrorCall' is thrown to the caller: by a plan without a schedule, and
--   by a property that returns without a simulation.
--
-- >>> :{
-- report <- explore (exhaustively 1) $ \simulate -> do
--   run <- simulate (parallel (sleep 1) (sleep 2))
--   if finished run == 1 then pure () else fail "the first to finish does not end it"
-- :}
--
-- >>> (reportComplete report, reportStarted report)
-- (True,["parallel: left","parallel: right"])
--
-- >>> explore (randomly 100) (\_ -> pure ())
-- *** Exception: explore: the property has simulated nothing, so it shows nothing: it is given a function, and has to simulate with it
--
-- @since 0.1.0.0
explore :: Plan -> ((Behavior a -> IO (Run a)) -> IO ()) -> IO Report
explore plan property =
  tryExplore plan property >>= \case
    Left counterexample -> throwIO counterexample
    Right report -> pure report

-- | 'explore' that returns the counterexample.
--
-- >>> let inTime run = if finished run > 0 then fail "late" else pure ()
-- >>> found <- tryExplore (exhaustively 1) (\simulate -> simulate (sleep 1) >>= inTime)
-- >>> either failingSchedule (error . show) found
-- Preempting []
--
-- @since 0.1.0.0
tryExplore
  :: Plan -> ((Behavior a -> IO (Run a)) -> IO ()) -> IO (Either Counterexample Report)
tryExplore plan property = case planSearch plan of
  Random n seed
    | n < 1 -> refused "a random plan has at least 1 schedule" n
    | otherwise -> randomSearch n seed
  Exhaustive k limit
    | k < 0 -> refused "an exhaustive plan has at least 0 pre-emptions" k
    | limit < 1 -> refused "an exhaustive plan has at least 1 schedule" limit
    | otherwise -> fullSearch k limit
  Replay s -> only s $ \e t ->
    pure (counterexample s e t 1)
  Shrink s -> only s (reduced 1)
 where
  o = planOptions plan
  counterexample schedule why trial n =
    Counterexample
      { failingSchedule = schedule
      , failingException = why
      , failingSteps = happened trial
      , failingEvents = traceOfRun trial
      , schedulesTried = n
      , foundBy = plan
      }
  tryUnder choosing = tryRun o choosing property
  refused why n = throwIO (ErrorCall ("explore: " ++ why ++ ", and not " ++ show n))

  only s onFailure = do
    t <- tryUnder (policy s)
    case thrown t of
      Nothing -> pure (Right (reported True (counting noTrials t)))
      Just e -> Left <$> onFailure e t

  randomSearch n seed = go 1 noTrials
   where
    go i !before
      | i > n = pure (Right (reported True before))
      | otherwise = do
          -- (So two seeds have different schedules, unless a plan has more than a million.)
          t <- tryUnder (policy (Seeded (seed * 1000003 + i)))
          case thrown t of
            Nothing -> go (i + 1) (counting before t)
            Just e -> Left <$> reduced i e t

  -- The queue is a stack. It holds the alternatives to the decisions of the last schedule,
  -- and to those of the prefixes that this schedule continues.
  fullSearch k limit = go 1 noTrials (emptyPrefix k) []
   where
    go :: Int -> Tally -> Prefix -> [Alternatives] -> IO (Either Counterexample Report)
    go n !before prefix others
      | n > limit = pure (Right (reported False before))
      | otherwise = do
          (t, queue) <- branching prefix others
          case (thrown t, nextPrefix queue) of
            (Just e, _) -> Left <$> reduced n e t
            (Nothing, Just (next, rest)) -> go (n + 1) (counting before t) next rest
            (Nothing, Nothing) -> pure (Right (reported True (counting before t)))

  -- Runs the non-preemptive schedule except for the choices of the prefix, and puts the
  -- alternatives to the decisions after them in front of the queue.
  branching prefix others = do
    queue <- newIORef others
    t <- tryUnder . fully (choices prefix) $ \d ->
      traverse_ (\more -> modifyIORef' queue (more :)) (alternatives prefix d)
    (,) t <$> readIORef queue

  reduced i e t = do
    (fewer, e') <- shrunk (deviations t) e
    (fewest, lastWhy) <- simplest fewer e'
    again <- tryRun o {detailedSteps = True} (preempting True fewest) property
    let why = fromMaybe (toException (Unrepeatable (planShowException plan lastWhy))) (thrown again)
    pure (counterexample (Preempting fewest) why again i)

  -- Leaving out one pre-emption changes the numbers of the later points, so the remaining
  -- pre-emptions may no longer fit. So this searches from the beginning, the schedules with the
  -- fewest choices first. It drops the part of the queue that the budget cannot reach: it could
  -- be large.
  simplest :: [(Int, Int)] -> SomeException -> IO ([(Int, Int)], SomeException)
  simplest known why = go (2000 :: Int) (emptyPrefix 2) [] Seq.empty
   where
    go budget prefix others later
      | budget <= 0 || choiceCount prefix >= length known = pure (known, why)
      | otherwise = do
          (t, further) <- branching prefix []
          case thrown t of
            Just e -> pure (choices prefix, e)
            Nothing -> continue (budget - 1) others (Seq.take budget (later <> Seq.fromList further))
    continue budget others later = case nextPrefix others of
      Just (prefix, rest) -> go budget prefix rest later
      Nothing
        | null later -> pure (known, why)
        | otherwise -> continue budget (toList later) Seq.empty

  -- Leaves out halves, quarters... of the pre-emptions, as long as the property still fails.
  shrunk :: [(Int, Int)] -> SomeException -> IO ([(Int, Int)], SomeException)
  shrunk start = go (500 :: Int) (length start) start
   where
    go budget chunk these why
      | chunk < 1 || budget <= 0 || null these = pure (these, why)
      | otherwise = attemptAll budget chunk (without chunk these) these why
    attemptAll budget chunk [] these why = go budget (chunk `div` 2) these why
    attemptAll budget chunk (candidate : more) these why
      | budget <= 0 = pure (these, why)
      | otherwise = do
          t <- tryUnder (preempting False candidate)
          case thrown t of
            Just e'
              | fewer <- deviations t
              , length fewer < length these ->
                  go (budget - 1) (min chunk (length fewer)) fewer e'
            _ -> attemptAll (budget - 1) chunk more these why
  without n these = [take i these ++ drop (i + n) these | i <- [0, n .. length these - 1]]
