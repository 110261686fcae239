{-# LANGUAGE LambdaCase #-}

-- |
-- Many schedules of one behaviour.
module Behavior.Internal.Sim.Explore
  ( Plan (..)
  , Search (..)
  , randomly
  , exhaustively
  , replaying
  , endingAt
  , explore
  , exploring
  , Report (..)
  , Counterexample (..)
  ) where

import Control.Exception hiding (Deadlock)
import Control.Monad (when)
import Data.IORef
import Data.List (dropWhileEnd, intercalate)
import Data.Maybe (fromMaybe)

import Behavior.Internal.Failure (Behavior, isCancellation)
import Behavior.Internal.Seconds (Seconds)
import Behavior.Internal.Sim.Policy
import Behavior.Internal.Sim.Report
import Behavior.Internal.Sim.Simulate
import Behavior.Internal.Sim.Types

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Sim

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
endingAt plan end = plan {under = (under plan) {endAt = end}}

-- | What was explored.
--
-- @since 0.1.0.0
data Report = Report
  { schedules :: Int
  -- ^ How many schedules were run.
  , complete :: Bool
  -- ^ Whether those were all that the plan asks for.
  , pointsInAll :: Int
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

-- | What the property threw once, but not when the same schedule was run again.
newtype Unrepeatable = Unrepeatable SomeException

instance Show Unrepeatable where
  show (Unrepeatable e) =
    text e
      ++ "\nBut when the same schedule was run again, this did not happen. Something in it is not simulated: \
         \a clock, a random number, a thread of forkIO, what an earlier run left behind?"

instance Exception Unrepeatable

-- | One run of the property: what it threw, and the run that it made.
data Trial = Trial
  { thrown :: Maybe SomeException
  , switches :: [(Int, Int)]
  , happened :: [Step]
  , size :: Int
  }

-- | Runs a property under many schedules, until one fails.
--
-- The property is given a function that simulates (as 'simulateWith' does, under the
-- schedule that is to be tried). It makes what it needs, simulates once, and throws if
-- something is wrong, as the expectations of test libraries do.
--
-- [Result] What was explored, if the property held under every schedule.
-- [Failure] If it did not: a 'Counterexample', whose schedule was shrunk to few
--   pre-emptions. Shrunk or not, it is replayed by 'replaying'.
-- [Fault] A run that is none ('Outside', 'Meddled', 'TooSlow', 'Misfit') is thrown to
--   the property, in words.
--
-- >>> :{
-- report <- explore (exhaustively 1) $ \simulate -> do
--   run <- simulate (parallel (sleep 1) (sleep 2))
--   if finished run == 1 then pure () else fail "the first to finish does not end it"
-- :}
--
-- >>> complete report
-- True
--
-- @since 0.1.0.0
explore :: Plan -> ((Behavior a -> IO (Run a)) -> IO ()) -> IO Report
explore plan property =
  exploring plan property >>= \case
    Left counterexample -> throwIO counterexample
    Right report -> pure report

-- | 'explore' that gives the counterexample.
--
-- >>> found <- exploring (exhaustively 1) (\simulate -> simulate (sleep 1) >>= \run -> if finished run > 0 then fail "late" else pure ())
-- >>> either failing (error . show) found
-- Switching []
--
-- @since 0.1.0.0
exploring
  :: Plan -> ((Behavior a -> IO (Run a)) -> IO ()) -> IO (Either Counterexample Report)
exploring (Plan how o) property = case how of
  Random n seed -> randomSearch n seed
  Exhaustive k limit -> fullSearch k limit
  Replay s -> do
    t <- try' (policy s)
    case thrown t of
      Nothing -> pure (Right (Report 1 True (size t)))
      Just e -> pure (Left (Counterexample s e (happened t) 1))
 where
  try' chooser' = attempting o chooser' property

  randomSearch n seed = go 1 0
   where
    go i total
      | i > n = pure (Right (Report n True total))
      | otherwise = do
          t <- try' (policy (Seeded (seed * 1000003 + i)))
          case thrown t of
            Nothing -> go (i + 1) (total + size t)
            Just e -> Left <$> reduced i e t

  fullSearch k limit = go 0 0 [([], k)]
   where
    go :: Int -> Int -> [Prefix] -> IO (Either Counterexample Report)
    go n total [] = pure (Right (Report n True total))
    go n total (prefix : others)
      | n >= limit = pure (Right (Report n False total))
      | otherwise = do
          (t, further) <- branching prefix
          case thrown t of
            Nothing -> go (n + 1) (total + size t) (further ++ others)
            Just e -> Left <$> reduced (n + 1) e t

  -- Runs the undisturbed schedule but for these exceptions; and which more there could
  -- be, after them.
  branching (switches', left) = do
    found <- newIORef []
    let tell d =
          let cost = if canGoOn d then 1 else 0
              further = [(switches' ++ [(decisionPoint d, c)], left - cost) | c <- candidates d, c /= usual d]
           in when (cost <= left) (modifyIORef' found (further ++))
    t <- try' (fully switches' tell)
    (,) t <$> readIORef found

  reduced i e t = do
    (fewer, e') <- shrunk (switches t) e
    (fewest, e'') <- simplest fewer e'
    again <- attempting o {detailed = True} (switching True fewest) property
    let why = fromMaybe (toException (Unrepeatable e'')) (thrown again)
    pure Counterexample {failing = Switching fewest, because = why, story = happened again, foundAfter = i}

  -- To leave out one switch moves what comes after it, so that the others may miss their
  -- points. So it looks afresh, the schedules with the fewest switches first.
  simplest :: [(Int, Int)] -> SomeException -> IO ([(Int, Int)], SomeException)
  simplest known why = go (2000 :: Int) [([], 2 :: Int)] []
   where
    go budget [] later
      | null later || budget <= 0 = pure (known, why)
      | otherwise = go budget (reverse later) []
    go budget (prefix : others) later
      | budget <= 0 || length (fst prefix) >= length known = pure (known, why)
      | otherwise = do
          (t, further) <- branching prefix
          case thrown t of
            Just e -> pure (fst prefix, e)
            Nothing -> go (budget - 1) others (foldl (flip (:)) later further)

  -- Leaves out halves, quarters... of the switches, as long as it still fails.
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
          t <- try' (switching False candidate)
          case thrown t of
            Just e' | length (switches t) < length these -> go (budget - 1) (min chunk (length (switches t))) (switches t) e'
            _ -> attemptAll (budget - 1) chunk more these why
  without n these = [take i these ++ drop (i + n) these | i <- [0, n .. length these - 1]]

-- | Switches, and how many pre-emptions more there may be.
type Prefix = ([(Int, Int)], Int)

-- | Runs the property once.
attempting :: Options -> IO Policy -> ((Behavior a -> IO (Run a)) -> IO ()) -> IO Trial
attempting o choosing property = do
  made <- newIORef Nothing
  let simulating act = do
        before <- readIORef made
        case before of
          Just _ -> throwIO (ErrorCall "explore: a property simulates only once")
          Nothing -> do
            chooser' <- choosing
            run <- simulateBy o chooser' act
            let switched = case schedule run of
                  Switching s -> s
                  _ -> []
            writeIORef made (Just (switched, steps run, points run))
            case outcome run of
              Outside _ _ -> improper run
              Meddled _ -> improper run
              TooSlow _ _ -> improper run
              Misfit _ -> improper run
              _ -> pure run
      improper run = throwIO (ErrorCall (explain (outcome run)))
  end <- try (property simulating)
  (s, h, n) <- fromMaybe ([], [], 0) <$> readIORef made
  case end of
    Right () -> pure (Trial Nothing s h n)
    Left e
      | isCancellation e -> throwIO e
      | otherwise -> pure (Trial (Just e) s h n)
