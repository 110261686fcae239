-- |
-- Four robots with simulated hardware, in real time: each prints what it does, for some seconds.
module Main (main) where

import Control.Exception (ErrorCall (..), onException, throwIO)
import Control.Monad (forever, void, when)
import Data.List (intercalate)
import Data.Maybe (isJust)
import Options.Applicative
import System.Exit (die)
import System.IO (BufferMode (..), hSetBuffering, stdout)

import Behavior
import Behavior.Live (LivePage (pageRobot), Viewing (..), viewEvents, viewing)
import Behavior.Message (withInbox)
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Sim (Outcome (Returned), Run (..), defaultSimOptions, endAt, explain, simulateWith)
import Behavior.Sim.Mock (begin, condition, driver, newMock, set, signal)
import Behavior.Trace (named)
import Drone (Drone (Drone), drone)
import qualified Drone
import Fleet (Fleet (Fleet), Robot (Robot), fleet)
import qualified Fleet
import Patrol (Patrol (Patrol), patrol)
import qualified Patrol
import PickAndPlace
import ViewingOptions (viewingOptions)

main :: IO ()
main = do
  hSetBuffering stdout LineBuffering
  o <- customExecParser defaultPrefs commandLine
  when (inSimulation o && isJust (livePage (shown o))) $
    die "robots: option --live shows a robot while it runs; allowed: without --simulate"
  let mission = named "mission" (demo o putStrLn) >> putStrLn "the demo is over"
  runBehavior $
    if inSimulation o
      then do
        run <- simulateWith defaultSimOptions {endAt = 3600} mission
        viewEvents (shown o) (events run)
        case outcome run of
          Returned () -> pure ()
          other -> throwIO (ErrorCall ("the simulation: " ++ explain other))
      else viewing (shown o) mission

data Options = Options
  { demo :: (String -> Behavior ()) -> Behavior ()
  , inSimulation :: Bool
  , shown :: Viewing
  }

commandLine :: ParserInfo Options
commandLine =
  info (helper <*> options) $
    fullDesc
      <> failureCode 2
      <> progDesc "Runs a robot with simulated hardware, for some seconds: it prints what it does."
 where
  options =
    onItsPage
      <$> argument (eitherReader chosen) (metavar "ROBOT" <> help names)
      <*> switch (long "simulate" <> help "run it in virtual time")
      <*> viewingOptions "robot"
  chosen name =
    maybe (Left ("not a robot: " ++ show name ++ "; allowed: " ++ names)) (Right . (,) name) (lookup name demos)
  onItsPage (name, run) simulated v =
    Options run simulated v {livePage = (\page -> page {pageRobot = name}) <$> livePage v}
  names = intercalate ", " (map fst demos)

demos :: [(String, (String -> Behavior ()) -> Behavior ())]
demos = [("patrol", patrolDemo), ("pick-and-place", pickAndPlaceDemo), ("drone", droneDemo), ("fleet", fleetDemo)]

-- | An action that takes time: says when it starts, and when it is stopped early.
step :: (String -> Behavior ()) -> String -> Seconds -> Behavior ()
step say name seconds = named name $ say name >> sleep seconds `onException` say ("(stopped: " ++ name ++ ")")

patrolDemo :: (String -> Behavior ()) -> Behavior ()
patrolDemo say = do
  world <- newMock
  low <- condition world "battery low" [(0, False), (2.3, True)]
  seen <- condition world "person seen" [(0, False), (4, True)]
  button <- condition world "red button" [(0, False), (7, True)]
  begin world
  patrol
    Patrol
      { Patrol.waypoints = ["gate", "yard", "store"]
      , Patrol.driveTo = \place -> step say ("drive to the " ++ place) 0.8
      , Patrol.report = \place -> say ("all is well at the " ++ place)
      , Patrol.recharge = step say "recharge" 0.7 >> set low False
      , Patrol.investigate = step say "say hello to the person" 0.7 >> set seen False
      , Patrol.motorsOff = say "motors off"
      , Patrol.batteryLow = signal low
      , Patrol.personSeen = signal seen
      , Patrol.redButton = signal button
      }

pickAndPlaceDemo :: (String -> Behavior ()) -> Behavior ()
pickAndPlaceDemo say = do
  world <- newMock
  -- The first grip misses the part; it slips once on the way.
  held <- condition world "holding" [(0, False)]
  grips <- newTVarIO [False, True, True]
  moves <- newTVarIO (0 :: Int)
  let slips = do
        n <- atomically (modifyTVar' moves (+ 1) >> readTVar moves)
        when (n == 1) (sleep 0.5 >> say "(the part slips)" >> set held False)
  pickAndPlace
    Arm
      { detectors = [pure 12.1, forever (sleep 3600), sleep 0.3 >> pure 12.5]
      , moveTo = \place -> case place of
          Box -> void (both (step say "move to the box" 1) slips)
          _ -> step say ("move to " ++ show place) 0.5
      , gripper = \wanted -> do
          step say (if wanted == Open then "open" else "close") 0.3
          holds <-
            if wanted == Open
              then pure False
              else atomically (stateTVar grips (\left -> (take 1 left == [True], drop 1 left)))
          set held holds
      , holding = signal held
      , park = step say "park the arm" 0.5
      }

droneDemo :: (String -> Behavior ()) -> Behavior ()
droneDemo say = do
  world <- newMock
  windy <- condition world "strong wind" [(0, False)]
  low <- condition world "battery low" [(0, False), (4.5, True)]
  crane <- newTVarIO False
  begin world
  drone
    Drone
      { Drone.motorsOn = say "motors on"
      , Drone.takeOff = step say "take off" 0.5
      , Drone.land = step say "land" 0.5
      , Drone.motorsOff = say "motors off"
      , Drone.flyTo = \place -> step say ("fly to " ++ place) 0.8
      , Drone.home = "home"
      , Drone.film = say "camera on" >> sleep 3600 `onException` say "camera off"
      , Drone.firstPath = ["row 1", "row 2", "row 3", "row 4", "row 5"]
      , Drone.nextPath = do
          again <- readTVarIO crane
          sleep (if again then 3600 else 1.2)
          atomically (writeTVar crane True)
          say "(there is a crane: the planner computes a new path)"
          sleep 0.6
          pure ["row 5", "row 4", "row 3"]
      , Drone.timeLimit = 60
      , Drone.strongWind = signal windy
      , Drone.batteryLow = signal low
      , Drone.logLine = say
      }

fleetDemo :: (String -> Behavior ()) -> Behavior ()
fleetDemo say = do
  world <- newMock
  orders <- driver world "orders" [(0.1, n) | n <- [1 .. 6]]
  chargers <- atomically (newTSem 1)
  handedOver <- newTVarIO (0 :: Int)
  let tell who text = say (who ++ ": " ++ text)
      robotOf who lowAt = do
        low <- condition world (who ++ ": battery low") [(0, False), (lowAt, True)]
        pure
          Robot
            { Fleet.name = who
            , Fleet.carry = \order -> do
                step (tell who) ("carry order " ++ show order) 1
                when (who == "Bo" && order > 3) (throwIO (userError "a wheel is lost"))
            , Fleet.handOver = \order -> do
                tell who ("order " ++ show order ++ " is handed over")
                atomically (modifyTVar' handedOver (+ 1))
            , Fleet.charge = step (tell who) "charge" 0.8 >> set low False
            , Fleet.batteryLow = signal low
            , Fleet.withdrawn = pure False
            }
  robots <- traverse (uncurry robotOf) [("Ann", 1.4), ("Bo", 60), ("Cid", 1.5)]
  begin world
  withInbox 10 orders $ \inbox ->
    named "all six orders" (Signal.waitUntil ((== 6) <$> Signal.watching (readTVar handedOver)))
      ||| fleet Fleet {Fleet.orders = inbox, Fleet.chargers = chargers, Fleet.logLine = say} robots
