{-# LANGUAGE LambdaCase #-}

-- |
-- What the specs of the four robots share: a property of a robot that is run under many schedules.
module Examples.WorstDay
  ( Day
  , survives
  , failsWith
  , inOneRun
  , ended
  ) where

import Control.Monad (unless, void)
import Data.List (isInfixOf)
import Test.Hspec

import Behavior
import Behavior.Sim
import RoverTrial (asHspec)

-- | Runs a robot in a mock world by means of the given function, and checks the record.
type Day = (Behavior () -> IO (Run ())) -> IO ()

-- | The day has a good end under each of the given number of random schedules.
survives :: Int -> Day -> Expectation
survives n day = void (explore (plan n) day)

-- | Under one of the given number of random schedules the day has a bad end, with this in its text.
failsWith :: String -> Int -> Day -> Expectation
failsWith why n day =
  tryExplore (plan n) day >>= \case
    Right report -> expectationFailure ("the wrong version is not rejected: " ++ show report)
    Left counterexample ->
      unless (why `isInfixOf` asHspec (reason counterexample)) $
        expectationFailure ("it is rejected for another reason:\n" ++ show counterexample)

plan :: Int -> Plan
plan n = (randomly n `endingAt` 1000) {showException = asHspec}

-- | The day under the default schedule only.
inOneRun :: Day -> Expectation
inOneRun day = day simulate

-- | How the robot has ended: as 'show' prints it.
ended :: Run () -> String
ended run = case outcome run of
  Returned () -> "returned"
  Failing e -> "failure: " ++ show e
  Faulting e -> "fault: " ++ show e
  _ -> explain (outcome run)
