-- |
-- Simulation as a property of QuickCheck.
--
-- Each test that QuickCheck runs is a schedule. With 'forAll' around it, behaviours (or
-- worlds, or sensors' readings) are generated too.
--
-- >>> import Behavior
-- >>> import Behavior.Sim
-- >>> import Test.QuickCheck
--
-- >>> :{
-- quickCheck . forAll durations $ \(s, t) -> underSchedules $ \simulate -> do
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
  , durations
  , duration
  ) where

import Control.Exception (Exception (..), throwIO)
import Control.Monad ((>=>))
import Test.QuickCheck

import Behavior (Behavior, Seconds)
import Behavior.Sim

-- | Holds if the property does under every schedule tried; each test tries one.
--
-- What the property gives may be anything that QuickCheck can test; it may also throw. Then
-- the schedule is shrunk, and told as a 'Counterexample'.
--
-- @since 0.1.0.0
underSchedules :: Testable prop => ((Behavior a -> IO (Run a)) -> IO prop) -> Property
underSchedules = underSchedulesOf 1

-- | 'underSchedules' that tries so many schedules for each test: of use when what is
-- generated around it is costly, or more interesting than the schedules.
--
-- @since 0.1.0.0
underSchedulesOf :: Testable prop => Int -> ((Behavior a -> IO (Run a)) -> IO prop) -> Property
underSchedulesOf n body =
  -- The seed is not shrunk: the schedule is, and better.
  forAllBlind chooseAny $ \seed -> ioProperty $ do
    found <- exploring (Plan (Random n seed) defaults) (body >=> holds)
    pure $ case found of
      Left c -> counterexample (show c) False
      Right _ -> property True

-- | Throws if it does not.
holds :: Testable prop => prop -> IO ()
holds prop = do
  result <- quickCheckWithResult stdArgs {chatty = False, maxSuccess = 1} prop
  case result of
    Failure {} -> throwIO (DoesNotHold (output result))
    _ -> pure ()

newtype DoesNotHold = DoesNotHold String

instance Show DoesNotHold where
  show (DoesNotHold text) = text

instance Exception DoesNotHold

-- | Any random schedule.
--
-- @since 0.1.0.0
anySchedule :: Gen Schedule
anySchedule = Seeded <$> chooseAny

-- | Leaves out switches.
--
-- @since 0.1.0.0
shrinkSchedule :: Schedule -> [Schedule]
shrinkSchedule (Switching switches) = Switching <$> shrinkList (const []) switches
shrinkSchedule _ = [Undisturbed]

-- | Two durations that are often the same.
--
-- @since 0.1.0.0
durations :: Gen (Seconds, Seconds)
durations = (,) <$> duration <*> duration

-- | A duration of 0, 1, 2... up to 5 seconds: so that ties are frequent.
--
-- @since 0.1.0.0
duration :: Gen Seconds
duration = fromIntegral <$> choose (0, 5 :: Int)
