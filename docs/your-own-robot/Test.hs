-- | One day of the robot, in virtual time and under a thousand schedules: on its way the battery
-- becomes low, and no one is at home.
module Main (main) where

import Control.Monad (unless)

import Behavior.Sim
import Behavior.Sim.Mock
import Mission

main :: IO ()
main = do
  report <- explore (randomly 1000) $ \simulated -> do
    world <- newMock
    level <- condition world "battery" [(0, 50), (4, 19)]
    wheels <- condition world "wheels turn" [(0, False)]
    drive <- actionOn world "drive to" (const [succeeds `taking` 5])
    ring <- action world "hand over" [fails "no one opens" `taking` 30]
    down <- action world "put down" [succeeds]
    full <- action world "charge" [succeeds `taking` 60 `causing` set level 100]
    run <-
      simulated . mission $
        Robot
          { battery = signal level
          , driveTo = \place -> set wheels True >> drive place
          , stopWheels = set wheels False
          , handOver = ring
          , putDown = down
          , charge = full
          }
    well run
    world `shouldRecord` whenever (becoming "battery" (19 :: Int)) (withinSeconds 6 (startOf "charge"))
    world `shouldRecord` (startOf "hand over" `comesBefore` startOf "put down" <> exactly 1 (successOf "put down"))
    world `shouldRecord` whenever (becoming "wheels turn" True) (eventually (becoming "wheels turn" False))
    world `shouldRecord` never (running "charge" `overlapping` being "wheels turn" True)
  print report
  unless (null (reportNeverStarted report ++ reportNeverCame report)) $ fail "the test does not show what it seems to"
