-- |
-- Simulations as QuickCheck properties.
--
-- Each test that QuickCheck runs is a schedule. With 'forAll' around the property, behaviours
-- (or worlds, or sensors' readings) are generated too.
--
-- >>> import Behavior
-- >>> import Behavior.Sim
-- >>> import Test.QuickCheck
--
-- >>> :{
-- quickCheck . forAll anyDurations $ \(s, t) -> underSchedules $ \simulate -> do
--   run <- simulate (both (sleep s) (sleep t))
--   pure (finished run === max s t)
-- :}
-- +++ OK, passed 100 tests.
module Behavior.Sim.QuickCheck
  ( -- * Properties
    underSchedules
  , underSchedulesOf

    -- * Generators
  , anySchedule
  , shrinkSchedule
  , anyDurations
  , anyDuration
  ) where

import Control.Exception (Exception (..), SomeAsyncException, throwIO)
import Control.Monad (unless, when)
import Data.Foldable (for_)
import Data.IORef
import Data.Maybe (isJust, isNothing)
import Test.QuickCheck hiding (Property, Result, theException)
import Test.QuickCheck.Gen.Unsafe (Capture (..), capture)
import Test.QuickCheck.Property
  ( Callback (PostFinalFailure)
  , CallbackKind (Counterexample)
  , Prop (..)
  , Property (..)
  , Result (..)
  , Rose (..)
  , exception
  , ioRose
  , reduceRose
  , rejected
  )
import Test.QuickCheck.State (terminal)
import Test.QuickCheck.Text (putLine)

import Behavior (Behavior, Seconds)
import Behavior.Sim hiding (Counterexample (Counterexample))
import qualified Behavior.Sim as Sim

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Sim
-- >>> import Test.QuickCheck

-- | Runs a property under a schedule that QuickCheck draws, a new one for each test.
--
-- The property is given a function that simulates under that schedule, once (a test that has simulated
-- nothing fails, unless it is discarded). It returns
-- anything that QuickCheck can test, and QuickCheck decides as usual: a discarded test is
-- discarded, 'expectFailure' expects a failure, labels, tables and coverage are counted, and
-- values that are generated inside have the test's seed and size. It may also throw, as the
-- expectations of test libraries do.
--
-- When the property fails, the schedule is shrunk first, then the values that were generated
-- inside, as long as the schedule fits; and 'counterexample' shows the steps. (Values that are
-- generated around the property are shrunk before both.)
--
-- >>> :{
-- quickCheck . underSchedules $ \simulate -> do
--   run <- simulate (parallel (sleep 1) (sleep 2))
--   pure (collect (finished run) True)
-- :}
-- +++ OK, passed 100 tests (100% 1.0).
--
-- @since 0.1.0.0
underSchedules :: Testable prop => ((Behavior a -> IO (Run a)) -> IO prop) -> Property
underSchedules = underSchedulesOf 1

-- | 'underSchedules' with the given number of schedules for each test, at least 1: useful if the
-- values that are generated around it are costly, or more interesting than the schedules.
--
-- One of the schedules decides a test: the first that fails or is discarded, or else the last.
-- Only its labels, tables and coverage count, so that percentages are still percentages of tests.
--
-- @since 0.1.0.0
underSchedulesOf :: Testable prop => Int -> ((Behavior a -> IO (Run a)) -> IO prop) -> Property
underSchedulesOf n body
  | n < 1 = errorWithoutStackTrace ("underSchedulesOf: at least 1 schedule for each test, and not " ++ show n)
  | otherwise = again . MkProperty $ do
      drawn <- vectorOf n anySchedule
      Capture generated <- capture
      let tested prop = unProp (generated (unProperty (property prop)))
          underOne = underSchedule (fmap tested . body)
      pure (MkProp (foldr1 orElse (map underOne drawn)))

-- | The first result if it is not a success, otherwise the second.
orElse :: Rose Result -> Rose Result -> Rose Result
first `orElse` second = IORose $ do
  decided@(MkRose result _) <- reduceRose first
  if ok result == Just True then reduceRose second else pure decided

-- | The verdict under this schedule. To shrink a failure, a simpler schedule is tried first, and
-- then the property's own smaller cases.
underSchedule :: ((Behavior a -> IO (Run a)) -> IO (Rose Result)) -> Schedule -> Rose Result
underSchedule body drawn = ioRose $ do
  MkRose result smaller <- tried (Replay drawn)
  pure (MkRose result ([IORose (tried (Shrink drawn)) | falsified result] ++ smaller))
 where
  tried how = do
    latest <- newIORef (MkRose rejected [])
    over <- newIORef Nothing
    shown <- newIORef Nothing
    idle <- newIORef True
    -- While it is shrunk, which is after the exploration, the property may simulate again.
    let simulateBy explored act = writeIORef idle False >> readIORef over >>= maybe (explored act) (later act)
        later act chosen = do
          run <- simulateWith (planOptions plan) {scheduled = chosen} act
          -- The schedule may not fit the shrunk values.
          when (isMismatch (outcome run)) discard
          modifyIORef shown (fmap (\c -> c {failingSteps = steps run}))
          pure run
        plan = (replaying drawn) {planSearch = how}
    found <- tryExplore plan $ \explored -> do
      rose@(MkRose result _) <- reduceRose (ioRose (body (simulateBy explored)))
      writeIORef latest rose
      for_ (theException result) $ \e -> when (isCancellation e) (throwIO e)
      -- A case that is discarded need not simulate.
      discarded <- (isNothing (ok result) &&) <$> readIORef idle
      when (falsified result || discarded) (throwIO Falsified)
    -- What the property was not to catch.
    for_ (either (Just . failingException) (const Nothing) found) $ \e ->
      unless (isFalsified e) (writeIORef latest (MkRose (exception "Exception" e) []))
    writeIORef over (Just (either failingSchedule (const drawn) found))
    writeIORef shown (either Just (const Nothing) found)
    readIORef latest >>= explained shown
  isMismatch (ScheduleMismatch _) = True
  isMismatch _ = False
  isFalsified e = isJust (fromException e :: Maybe Falsified)
  isCancellation e = isJust (fromException e :: Maybe SomeAsyncException)

-- | Adds to each failure the schedule and the steps of its run.
explained :: IORef (Maybe Sim.Counterexample) -> Rose Result -> IO (Rose Result)
explained shown rose = do
  MkRose result smaller <- reduceRose rose
  happened <- fmap renderSchedule <$> readIORef shown
  let with shownText =
        result {callbacks = printing shownText : callbacks result, testCase = shownText : testCase result}
      shrunk = map (IORose . explained shown) smaller
  pure (MkRose (if falsified result then maybe result with happened else result) shrunk)
 where
  printing shownText = PostFinalFailure Counterexample (\state _ -> putLine (terminal state) shownText)

falsified :: Result -> Bool
falsified result = ok result == Just False && expect result

-- | Thrown by the property inside 'tryExplore', which then returns a counterexample.
data Falsified = Falsified
  deriving (Show)

instance Exception Falsified

-- | Any random schedule.
--
-- @since 0.1.0.0
anySchedule :: Gen Schedule
anySchedule = Seeded <$> chooseAny

-- | Leaves out pre-emptions.
--
-- @since 0.1.0.0
shrinkSchedule :: Schedule -> [Schedule]
shrinkSchedule (Preempting exceptions) = Preempting <$> shrinkList (const []) exceptions
shrinkSchedule _ = [NonPreemptive]

-- | Two durations that are often equal.
--
-- @since 0.1.0.0
anyDurations :: Gen (Seconds, Seconds)
anyDurations = (,) <$> anyDuration <*> anyDuration

-- | A duration of 0, 1, 2, 3, 4 or 5 seconds: so that ties are frequent.
--
-- @since 0.1.0.0
anyDuration :: Gen Seconds
anyDuration = fromIntegral <$> choose (0, 5 :: Int)
