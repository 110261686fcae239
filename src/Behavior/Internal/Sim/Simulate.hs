{-# OPTIONS_HADDOCK not-home #-}

-- |
-- A simulated run, from its beginning to its end.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Simulate
  ( simulate
  , simulateWith
  , simulateBy
  ) where

import Control.Concurrent
import Control.Exception hiding (Deadlock)
import Control.Monad (unless, when)
import Data.Foldable (for_)
import Data.Functor.Identity (Identity (..))
import Data.IORef
import qualified Data.IntMap.Strict as IntMap
import Data.Maybe (isJust)
import Data.Void (Void, absurd)
import System.IO.Unsafe (unsafePerformIO)

import Behavior.Internal.Core.Backend
import Behavior.Internal.Core.Dispatch
import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Core.Property (Property)
import Behavior.Internal.Core.SafeText (settledText)
import Behavior.Internal.Core.Seconds (duration)
import Behavior.Internal.Sim.Coverage (Reached)
import Behavior.Internal.Sim.Pending
import Behavior.Internal.Sim.Policy
import Behavior.Internal.Sim.Scheduler
import Behavior.Internal.Sim.State
import Behavior.Internal.Sim.Types
import Behavior.Internal.Sim.Watchdog
import Behavior.Internal.Spans.Event (traverseTexts)
import Behavior.Internal.Spans.Place (Receiver (..), Trace, inPlace, newTrace, placeIn, withReceiver)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Sim
-- >>> import Behavior.Time (now)
-- >>> import Control.Monad (forever)

-- | Runs a behaviour in a simulation, under the non-preemptive schedule.
--
-- > simulate  =  simulateWith defaultSimOptions
--
-- [Result] How the run ended ('Outcome'), even if the behaviour failed or faulted, or there was a
--   deadlock, a livelock, or a mistake that a simulation finds. It throws ('Threw') what makes the run void also if
--   the behaviour catches that: the use of a mock world of another run, and a claim that does not hold.
-- [Fault] A simulation inside a simulation throws an 'ErrorCall'.
-- [Cancellation] When the caller is cancelled, the run is ended, and then the cancellation is
--   thrown.
--
-- When it returns or throws, all threads of the run have ended, one after the other, the
-- youngest first. (When the run was ended early, the transactions of a cleanup still run and its
-- sleeps end at once, but a transaction that would have to wait is interrupted instead.) A thread that cannot be
-- unwound is left behind: it waits outside of this library, or goes on after each exception.
--
-- >>> run <- simulate (sleep 3600 >> now)
-- >>> explain (outcome run)
-- "it returned"
-- >>> finished run
-- 3600.0
--
-- @since 0.1.0.0
simulate :: Behavior a -> IO (Run a)
simulate = simulateWith defaultSimOptions

-- | 'simulate' with the given options. (A number there that is negative or NaN is refused with an 'ErrorCall'.)
--
-- >>> run <- simulateWith defaultSimOptions {scheduled = Seeded 7} (both (sleep 1) (sleep 2))
-- >>> finished run
-- 2.0
--
-- A behaviour that does not end needs an end time:
--
-- >>> run <- simulateWith defaultSimOptions {endAt = 10} (forever (sleep 3))
-- >>> putStrLn (explain (outcome run))
-- the virtual time has come to the end that was set
--   main waits for the end of its sleep
-- >>> finished run
-- 10.0
--
-- @since 0.1.0.0
simulateWith :: SimOptions -> Behavior a -> IO (Run a)
simulateWith o act = do
  chooser <- policy (scheduled o)
  fst <$> simulateBy o Nothing chooser act

-- | 'simulateWith' under the given policy, for the property that runs it. It also gives what the run could start,
-- and what it has started.
simulateBy :: SimOptions -> Maybe Property -> Policy -> Behavior a -> IO (Run a, Reached)
simulateBy o property chooser act = do
  nested <- simulator
  when (isJust nested) . throwIO . ErrorCall $
    "simulate: a simulation inside of a simulation: run the inner behaviour as part of the outer one"
  for_ [("endAt", endAt o), ("timerSlip", timerSlip o), ("realTimeLimit", realTimeLimit o)] (uncurry duration)
  when (livelockLimit o < 0) . throwIO . ErrorCall $
    "livelockLimit: a number of scheduling points is zero or more, not " ++ show (livelockLimit o)
  result <- newIORef Nothing
  n <- atomicModifyIORef' simulationNumber (\k -> (k + 1, k))
  sim <- newSim o chooser
  root <- placeIn [] <$> traceOf sim
  mask $ \restore -> withBackend n (simulation n property sim) . watched n sim $ do
    let run unmasked = try (inPlace (Just root) unmasked) >>= writeIORef result . Just
    (main, _) <- launch sim (-1) (Label "main" "") (\begin unmask -> run (unmask (begin >> act))) (const (pure ()))
    writeIORef (current sim) main
    putMVar (gate main) ()
    verdict <- try (restore (takeMVar (runEnd sim)))
    -- (Evaluated: otherwise a run that is kept would keep its threads, with their stacks.)
    left <- readIORef (tasks sim) >>= traverse (evaluate . taskLabel) . filter (isJust . taskThread) . IntMap.elems
    endTime <- readIORef (time sim)
    made <- reverse <$> readIORef (history sim)
    happened <- map (runIdentity . traverseTexts (Identity . settledText)) . reverse <$> readIORef (emitted sim)
    count <- readIORef (counter sim)
    started <- readIORef (reached sim)
    mistake <- readIORef (mistaken sim)
    uninterruptibleMask_ (unwind sim verdict)
    end <- readIORef result
    deviating <- reverse <$> readIORef (deviations sim)
    rest <- unused chooser
    case verdict of
      Left e -> throwIO (e :: SomeException)
      Right v ->
        pure
          ( Run
              { outcome = maybe (outcomeOf v end rest) Threw mistake
              , finished = endTime
              , steps = made
              , events = happened
              , runSchedule = Preempting deviating
              , runPoints = count
              , leakedThreads = left
              }
          , started
          )

simulationNumber :: IORef Int
simulationNumber = unsafePerformIO (newIORef 0)
{-# NOINLINE simulationNumber #-}

-- | The trace of a run, in virtual time.
traceOf :: Sim -> IO Trace
traceOf sim = withReceiver receiver <$> newTrace (readIORef (time sim))
 where
  receiver = Receiver {firstNumber = 1, needsDetail = True, receiveEvent = keep}
  keep event = event `seq` modifyIORef' (emitted sim) (event :)

-- | The outcome, from how the run was ended, the behaviour's result, and the rest of the schedule.
outcomeOf :: Maybe (Outcome Void) -> Maybe (Either SomeException a) -> [(Int, Int)] -> Outcome a
outcomeOf cutOff end rest = case (cutOff, rest, end) of
  (Just other, _, _) -> absurd <$> other
  (Nothing, (p, thread) : _, _) ->
    ScheduleMismatch
      ("the run ended before point " ++ show p ++ ", at which thread " ++ show thread ++ " was to run")
  (Nothing, [], Just (Right a)) -> Returned a
  (Nothing, [], Just (Left e)) -> Threw e
  (Nothing, [], Nothing) -> ScheduleMismatch "unreachable"

-- | Ends all tasks, the youngest first, one at a time.
unwind :: Sim -> Either SomeException (Maybe (Outcome Void)) -> IO ()
unwind sim verdict = do
  writeIORef (unwinding sim) True
  writeIORef (nextDecisionAt sim) minBound
  when keptTurn recall
  readIORef (tasks sim) >>= mapM_ (withdrawAll sim)
  writeIORef (driverRuns sim) True
  next
 where
  -- Whether the task that ran still has the turn.
  keptTurn = case verdict of
    Left _ -> True
    Right (Just (BlockedOutside _ _)) -> True
    Right (Just (TooSlow _ _)) -> True
    Right _ -> False

  -- The task returns the turn at its next operation, or at its end. If it reaches neither,
  -- the operation in which it waits is interrupted; if that does not help, the task is abandoned.
  recall = do
    returned <- soon 10
    unless returned $ do
      runner <- readIORef (current sim)
      mapM_ (\thread -> forkIO (throwTo thread Unwind)) (taskThread runner)
      interrupted <- soon 1000
      unless interrupted $ modifyIORef' (tasks sim) (IntMap.delete (taskNumber runner))

  soon :: Int -> IO Bool
  soon 0 = pure False
  soon k = do
    returned <- (||) <$> (isJust <$> tryTakeMVar (driverTurn sim)) <*> (isJust <$> tryTakeMVar (runEnd sim))
    if returned then pure True else threadDelay 1000 >> soon (k - 1)

  next = do
    alive <- readIORef (tasks sim)
    case IntMap.lookupMax alive of
      Nothing -> pure ()
      Just (n, task) -> do
        when (isJust (taskThread task)) $ do
          writeIORef (unwindAttempts sim) 0
          writeIORef (current sim) task
          putMVar (gate task) ()
          takeMVar (driverTurn sim)
        modifyIORef' (tasks sim) (IntMap.delete n)
        next
