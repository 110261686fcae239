{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- The texts that describe a run: its outcome and its steps.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Report
  ( explain
  , well
  , otherEndOf
  , renderSteps
  , ofThreads
  , mentioning
  , text
  ) where

import Control.Exception (ErrorCall (..), SomeException, throwIO)
import Data.List (groupBy, intercalate, isInfixOf)
import Numeric (showFFloat)

import Behavior.Internal.Core.Backend (Label)
import Behavior.Internal.Core.Failure (isCancellation, isFailure)
import Behavior.Internal.Core.SafeText
import Behavior.Internal.Core.Seconds (Seconds (..))
import Behavior.Internal.Core.Stop (displayed)
import Behavior.Internal.Sim.Types

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Sim
-- >>> import Behavior.STM (atomically)
-- >>> import Control.Concurrent.STM (retry)

-- | Describes how a run ended. If the cause is a mistake, the text says how to correct it.
--
-- >>> run <- simulate (both (sleep 1) (atomically retry))
-- >>> putStrLn (explain (outcome run))
-- deadlock: every thread waits, and nothing in the simulation will wake one
--   main waits for a transaction (its branches: both: right)
--   both: right waits for a transaction
--
-- @since 0.1.0.0
explain :: Outcome a -> String
explain = \case
  Returned _ -> "it returned"
  Threw e
    | isFailure e -> "it failed: " ++ text e
    | isCancellation e -> "it was cancelled: " ++ text e
    | otherwise -> "it faulted: " ++ text e
  Deadlock waiting -> listed "deadlock: every thread waits, and nothing in the simulation will wake one" waiting
  Livelock labels circles ->
    intercalate "\n  " $
      ("livelock: the virtual time does not advance while these threads run: " ++ commas labels) : circles
  OutOfTime waiting -> listed "the virtual time has come to the end that was set" waiting
  BlockedOutside name blocked -> show name ++ " waited outside of the simulation, " ++ waitAndAdvice blocked
  ExternalWakeup waiting ->
    listed
      "something outside of the simulation changed what these waited for (a thread of forkIO or async? \
      \start it by parallel, both or fork)"
      waiting
  TooSlow name (Seconds t) ->
    show name ++ " ran when the limit of real time was reached, at " ++ showFFloat (Just 3) t " s of virtual time: \
      \it computes for very long, or for ever (see realTimeLimit), or the behaviour has no end (see endAt)"
  ScheduleMismatch why -> "the schedule does not fit this behaviour: " ++ why

-- | The result of a run that has ended well: the behaviour has returned, and no thread of it is left.
-- Otherwise it throws an 'ErrorCall' with the text of 'explain', or with the threads that are left.
--
-- >>> simulate (sleep 1 >> pure 'a') >>= well
-- 'a'
-- >>> simulate (atomically retry) >>= well
-- *** Exception: deadlock: every thread waits, and nothing in the simulation will wake one
--   main waits for a transaction
--
-- In an exploration: @explore (randomly 1000) (\\simulated -> simulated mission >>= well)@.
--
-- @since 0.1.0.0
well :: Run a -> IO a
well run = case (outcome run, leakedThreads run) of
  (Returned a, []) -> pure a
  (Returned _, left) -> throwIO (ErrorCall ("it returned, but these threads were left running: " ++ commas left))
  (other, _) -> throwIO (ErrorCall (explain other))

-- | How a run ended, in a word or two, if it did not return.
otherEndOf :: Outcome a -> Maybe String
otherEndOf = \case
  Returned _ -> Nothing
  Threw e
    | isFailure e -> Just "failed"
    | isCancellation e -> Just "cancelled"
    | otherwise -> Just "faulted"
  Deadlock _ -> Just "deadlocked"
  Livelock _ _ -> Just "livelocked"
  OutOfTime _ -> Just "out of time"
  BlockedOutside _ _ -> invalid
  ExternalWakeup _ -> invalid
  TooSlow _ _ -> invalid
  ScheduleMismatch _ -> invalid
 where
  invalid = Just "not valid"

listed :: String -> [Waiting] -> String
listed title = intercalate "\n  " . (title :) . map (\(Waiting who what) -> show who ++ " waits for " ++ what)

waitAndAdvice :: Blocked -> String
waitAndAdvice = \case
  InMVar ->
    "at an MVar or for the time (takeMVar, threadDelay, System.Timeout.timeout, forkIO and a wait for it, \
    \output that is not read): \
    \use atomically and a TMVar, sleep, Behavior.Time.timeout, fork"
  InTransaction ->
    "in a transaction (Control.Concurrent.STM.atomically, or async's wait, race, concurrently): \
    \use Behavior.STM.atomically, parallel, both, fork"
  InThunk ->
    "for a value that another thread is computing (it was lazy, and to compute it waits, \
    \or takes longer than realTimeLimit): compute it before, by evaluate"
  InThrowing others ->
    listed
      "for another thread to receive an exception (throwTo, killThread, cancel): use parallel or fork; \
      \and a cleanup must not throw to the thread that waits for its end"
      others
  Elsewhere ->
    "for something unknown to this library (threadDelay): \
    \use atomically and a TMVar, sleep, Behavior.Time.timeout, fork"

-- | A line for each step (one line for consecutive equal steps): the virtual time, the number
-- and the label of the thread, and what it did.
--
-- >>> run <- simulate (parallel (sleep 1) (sleep 2))
-- >>> putStr (renderSteps (steps run))
--      0.000 s  1 parallel: left   starts
--      0.000 s  2 parallel: right  starts
--      1.000 s  1 parallel: left   ends
--      1.000 s  2 parallel: right  is interrupted: Stop: requested by the operator that started this behaviour
--      1.000 s  2 parallel: right  ends
--
-- For a branch inside another branch, the number of the outer one is added. So the branches of
-- two operators can be distinguished, whatever their labels are:
--
-- >>> run <- simulate (parallel (parallel (sleep 1) (sleep 1)) (parallel (sleep 1) (sleep 1)))
-- >>> putStr (renderSteps (take 6 (steps run)))
--      0.000 s  1 parallel: left          starts
--      0.000 s  2 parallel: right         starts
--      0.000 s  3 parallel: left (of 1)   starts
--      0.000 s  4 parallel: right (of 1)  starts
--      0.000 s  5 parallel: left (of 2)   starts
--      0.000 s  6 parallel: right (of 2)  starts
--
-- @since 0.1.0.0
renderSteps :: [Step] -> String
renderSteps made = unlines (concatMap (map line . take 1) (groupBy repeated made))
 where
  repeated s t = (stepTime s, stepThread s, stepKind s) == (stepTime t, stepThread t, stepKind t)
  line s =
    padLeft 10 (seconds (stepTime s)) ++ " s  " ++ padRight width (thread s) ++ "  " ++ aside (stepKind s)
  width = maximum (0 : map (length . thread) made)
  seconds (Seconds t) = showFFloat (Just 3) t ""
  padLeft n t = replicate (n - length t) ' ' ++ t
  padRight n t = t ++ replicate (n - length t) ' '

-- | The thread's number, its label, and the number of the branch that it is inside.
thread :: Step -> String
thread s = show (stepThread s) ++ " " ++ show (stepLabel s) ++ inside
 where
  inside = if stepParent s > 0 then " (of " ++ show (stepParent s) ++ ")" else ""

-- | Only the steps of the threads with the given numbers.
--
-- >>> run <- simulate (parallel (sleep 1) (sleep 2))
-- >>> putStr (renderSteps (ofThreads [1] (steps run)))
--      0.000 s  1 parallel: left  starts
--      1.000 s  1 parallel: left  ends
--
-- @since 0.1.0.0
ofThreads :: [Int] -> [Step] -> [Step]
ofThreads numbers = filter ((`elem` numbers) . stepThread)

-- | Only the steps whose line contains one of the given texts: for example a part of a thread's
-- label, or the name of an action or a condition.
--
-- >>> run <- simulate (parallel (sleep 1) (sleep 2))
-- >>> putStr (renderSteps (mentioning ["left", "interrupted"] (steps run)))
--      0.000 s  1 parallel: left   starts
--      1.000 s  1 parallel: left   ends
--      1.000 s  2 parallel: right  is interrupted: Stop: requested by the operator that started this behaviour
--
-- @since 0.1.0.0
mentioning :: [String] -> [Step] -> [Step]
mentioning texts = filter (\s -> any (`isInfixOf` (thread s ++ "  " ++ aside (stepKind s))) texts)

-- | The text of what a thread did.
aside :: StepKind -> String
aside = \case
  Starts -> "starts"
  Ends -> "ends"
  Note what -> what
  ReceivesException e -> "is interrupted: " ++ e
  Throws n target -> "requests the stop of " ++ show n ++ " " ++ show target
  Transacts -> "transaction"
  Sleeps (Seconds t)
    | isInfinite t -> "sleeps for ever"
    | otherwise -> "sleeps until " ++ showFFloat (Just 3) t " s"
  IsPreempted -> "-- another thread runs first"

commas :: [Label] -> String
commas = intercalate ", " . map show

-- | The text of an exception, without GHC's own additions.
text :: SomeException -> String
text = safeShow . displayed
