-- |
-- What the specs of the four robots share: a property of a robot that is run under many schedules.
module Examples.WorstDay
  ( Day
  , survives
  , survivesOf
  , failsWith
  , inOneRun
  , ended
  ) where

import Control.Exception (fromException)
import Control.Monad (unless, void)
import Data.IORef (modifyIORef, newIORef, readIORef)
import Data.List (isInfixOf)
import Test.Hspec

import Behavior
import Behavior.Sim
import RoverTrial (asHspec)

-- | Runs a robot in a mock world by means of the given function, and checks the record.
type Day = (Behavior () -> IO (Run ())) -> IO ()

-- | The day has a good end under each of the given number of random schedules.
survives :: Int -> Day -> Expectation
survives = survivesOf 0

-- | 'survives' under the random schedules of this seed.
survivesOf :: Int -> Int -> Day -> Expectation
survivesOf seed n day = void (explore (plan n) {planSearch = Random n seed} day)

-- | Under one of the given number of random schedules the day has a bad end, with this in its text.
-- (The bad ends are collected here, and not thrown to 'explore': it would shrink the schedule, which
-- takes longer than all the rest.)
failsWith :: String -> Int -> Day -> Expectation
failsWith why n day = do
  badEnds <- newIORef []
  report <- explore (plan n) $ \simulated ->
    tryAny (day simulated) >>= either (\e -> modifyIORef badEnds (asHspec e :)) pure
  found <- readIORef badEnds
  unless (any (why `isInfixOf`) found) $
    expectationFailure (unlines ("the wrong version is not rejected for this reason:" : show report : take 1 found))

plan :: Int -> Plan
plan n = (randomly n `endingAt` 1000) {planShowException = asHspec}

-- | The day under the default schedule only.
inOneRun :: Day -> Expectation
inOneRun day = day simulate

-- | How the robot has ended: as 'show' prints it.
ended :: Run () -> String
ended run = case outcome run of
  Returned () -> "returned"
  Threw e
    | Just BehaviorFailed {} <- fromException e -> "failure: " ++ show e
    | otherwise -> "fault: " ++ show e
  _ -> explain (outcome run)
