-- | The program on the robot. Its hardware is made up: put your drivers in the place of it.
module Main (main) where

import Control.Monad (replicateM_)
import System.IO (BufferMode (..), hSetBuffering, stdout)

import Behavior
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Trace.Viewing
import Mission

main :: IO ()
main = do
  hSetBuffering stdout LineBuffering
  level <- newTVarIO 25
  runBehavior . viewing defaultViewing {traceFile = Just "run.jsonl", timelineFile = Just "run.svg"} $
    mission
      Robot
        { battery = Signal.watching (readTVar level)
        , driveTo = \place -> do
            putStrLn ("drive to the " ++ place)
            replicateM_ 5 (sleep 0.2 >> atomically (modifyTVar' level (subtract 2)))
        , stopWheels = putStrLn "stop the wheels"
        , handOver = putStrLn "ring the bell" >> sleep 0.5 >> failWith "no one opens"
        , putDown = putStrLn "put the parcel down"
        , charge = putStrLn "charge" >> sleep 1 >> atomically (writeTVar level 100)
        }
