-- |
-- What the robot can do and perceive, with the names and types of the paper.
--
-- The paper's listings are closed definitions. So all of this acts in one global world of
-- the process, which 'inWorld' sets.
module Robot
  ( inWorld

    -- * Doors
  , Door
  , frontDoor
  , backDoor
  , door
  , findDoors
  , isOpen
  , open
  , passThrough
  , close
  , smash

    -- * The battery
  , batteryLevel
  , battery
  , batteryLow
  , recharge

    -- * Tasks
  , doTask
  , performTask
  , task

    -- * Conditions
  , insideRoom
  , doorOpen
  , doorClosed
  , closeToWall
  , dangerNearby
  , c1
  , c2
  , c3

    -- * Other actions
  , turn
  , moveForward
  , circle
  , hide
  , Box (..)
  , findBox
  , moveTo
  , a1
  , a2
  , a3
  , a4
  , a5
  ) where

import Control.Exception (bracket)
import Data.IORef (IORef, atomicModifyIORef', newIORef, readIORef, writeIORef)
import System.IO.Unsafe (unsafePerformIO)

import Battery (wholePercent)
import Behavior
import Behavior.STM (STM, modifyTVar', readTVar, readTVarIO, writeTVar)
import World

-- | Runs the action with this world as the world of this module.
inWorld :: World -> IO a -> IO a
inWorld world act = bracket (exchange (Just world)) (writeIORef currentWorld) (const act)
 where
  exchange new = atomicModifyIORef' currentWorld (\old -> (new, old))

currentWorld :: IORef (Maybe World)
currentWorld = unsafePerformIO (newIORef Nothing)
{-# NOINLINE currentWorld #-}

theWorld :: Behavior World
theWorld = readIORef currentWorld >>= maybe (error "Robot: there is no world; see inWorld") pure

-- | An action of this name, with this effect on the world.
acting :: String -> (World -> STM (Either String a)) -> Behavior a
acting name effect = theWorld >>= \world -> perform world name (effect world)

-- | An action that takes time and has no effect on the world.
idly :: String -> Behavior ()
idly name = acting name (\_ -> pure (Right ()))

succeeding :: STM a -> STM (Either String a)
succeeding = fmap Right

frontDoor, backDoor :: Door
frontDoor = FrontDoor
backDoor = BackDoor

-- | The door of the listings that have only one.
door :: Door
door = frontDoor

findDoors :: Behavior [Door]
findDoors = acting "find doors" (\_ -> succeeding (pure [frontDoor, backDoor]))

isOpen :: Door -> Behavior Bool
isOpen d = theWorld >>= \world -> (== Open) <$> readTVarIO (doorIs world d)

open :: Door -> Behavior ()
open d = acting ("open " ++ doorName d) $ \world -> do
  let becomes = writeTVar (doorIs world d)
      remains how = pure (Left ("the " ++ doorName d ++ " is " ++ how))
  state <- readTVar (doorIs world d)
  case state of
    Open -> succeeding (pure ())
    Closed -> succeeding (becomes Open)
    Jammed 0 -> succeeding (becomes Open)
    Jammed n -> becomes (Jammed (n - 1)) >> remains "jammed"
    Locked -> remains "locked"
    Sealed -> remains "sealed"

-- | Passes to the other side of the door: into the room or out of it.
passThrough :: Door -> Behavior ()
passThrough d = acting ("pass through " ++ doorName d) $ \world -> do
  state <- readTVar (doorIs world d)
  if state == Open
    then succeeding (modifyTVar' (holds world InsideRoom) not)
    else pure (Left ("the " ++ doorName d ++ " is not open"))

close :: Door -> Behavior ()
close d = acting ("close " ++ doorName d) $ \world ->
  succeeding (modifyTVar' (doorIs world d) (\state -> if state == Open then Closed else state))

smash :: Door -> Behavior ()
smash d = acting ("smash " ++ doorName d) $ \world -> do
  state <- readTVar (doorIs world d)
  if state == Sealed
    then pure (Left ("the " ++ doorName d ++ " is sealed"))
    else succeeding (writeTVar (doorIs world d) Open)

-- | The level of the battery: percent, from 0 to 100.
batteryLevel, battery :: Behavior Int
batteryLevel = theWorld >>= fmap wholePercent . batteryNow
battery = batteryLevel

batteryLow :: Behavior Bool
batteryLow = do
  world <- theWorld
  (< threshold (setting world)) <$> batteryLevel

-- | Recharges until the battery is full. The charger is outside the room.
recharge :: Behavior ()
recharge = do
  world <- theWorld
  recharging world . perform world "recharge" . succeeding $ do
    fillBattery world
    writeTVar (holds world InsideRoom) False

doTask, performTask, task :: Behavior ()
doTask = idly "do task"
performTask = idly "perform task"
task = idly "task"

insideRoom, closeToWall, dangerNearby, c1, c2, c3 :: Behavior Bool
insideRoom = whether InsideRoom
closeToWall = whether CloseToWall
dangerNearby = whether DangerNearby
c1 = whether C1
c2 = whether C2
c3 = whether C3

whether :: Condition -> Behavior Bool
whether condition = theWorld >>= \world -> readTVarIO (holds world condition)

doorOpen, doorClosed :: Behavior Bool
doorOpen = isOpen door
doorClosed = not <$> doorOpen

turn, moveForward, circle :: Behavior ()
turn = idly "turn"
moveForward = idly "move forward"
circle = idly "circle"

-- | Hides until the danger has passed.
hide :: Behavior ()
hide = acting "hide" (\world -> succeeding (writeTVar (holds world DangerNearby) False))

data Box = Box
  deriving (Eq, Show)

findBox :: Behavior Box
findBox = acting "find box" (\_ -> succeeding (pure Box))

moveTo :: Box -> Behavior ()
moveTo Box = idly "move to box"

a1, a2, a3, a4, a5 :: Behavior ()
a1 = idly "a1"
a2 = idly "a2"
a3 = idly "a3"
a4 = idly "a4"
a5 = idly "a5"
