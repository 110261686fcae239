-- |
-- The tests of the rover in the tutorial "Testing a robot".
module RoverTrial
  ( trial
  , wholeMission
  , wayHome
  , asHspec
  , charged
  , motorOnly
  ) where

import Control.Exception (SomeException (..), displayException)
import Control.Monad ((>=>))
import Data.Typeable (cast)
import Test.HUnit.Lang (HUnitFailure (..), formatFailureReason)
import Test.Hspec (shouldBe)

import Behavior
import Behavior.Sim
import Behavior.Sim.Mock
import Rover

-- | Runs a task of the rover in a mock field, with the button pressed at the given times,
-- and checks the record. The last argument is the function that runs the behaviour.
trial :: (Rover -> Behavior ()) -> [(Seconds, Bool)] -> (Behavior () -> IO ()) -> IO ()
trial task pressed run = do
  field <- newMock
  low <- condition field "battery low" [(0, False), (5, True)]
  button <- condition field "red button" pressed
  motor <- condition field "motor runs" [(0, False)]
  on <- action field "motor on" [succeeds `causing` set motor True]
  off <- action field "motor off" [succeeds `causing` set motor False]
  around <- action field "drive round" [succeeds `taking` 60]
  back <- action field "drive home" [succeeds `taking` 4]
  beep <- action field "honk" [succeeds]
  full <- action field "charge" [succeeds `taking` 20 `causing` set low False]
  run . task $
    Rover
      { motorOn = on
      , motorOff = off
      , driveRound = around
      , driveHome = back
      , honk = beep
      , charge = full
      , batteryLow = signal low
      , redButton = signal button
      }
  field `shouldRecord` whenever (becoming "motor runs" True) (eventually (becoming "motor runs" False))

-- | The button is pressed at the moment when the battery becomes low.
wholeMission :: (Rover -> Behavior ()) -> Plan -> IO Report
wholeMission home plan =
  explore plan $ \simulated ->
    trial (mission home) [(0, False), (5, True)] (simulated >=> well)

-- | Only the way home; the button is pressed from the beginning.
wayHome :: (Rover -> Behavior ()) -> Plan -> IO Report
wayHome home plan =
  explore plan $ \simulated ->
    trial (\rover -> untilButton rover (home rover)) [(0, True)] (simulated >=> well)

-- | Shows a failed expectation as hspec prints it.
asHspec :: SomeException -> String
asHspec (SomeException e) = case cast e of
  Just (HUnitFailure _ why) -> formatFailureReason why
  Nothing -> displayException e

-- | Expects that the rover is home and charged at this time, if the button is not pressed.
charged :: Seconds -> Plan -> IO Report
charged time plan =
  explore plan {planShowException = asHspec} $ \simulated ->
    trial goHome [(0, False)] (simulated >=> \run -> finished run `shouldBe` time)

motorOnly :: Plan
motorOnly = (exhaustively 0) {planSelectSteps = mentioning ["motor runs"]}
