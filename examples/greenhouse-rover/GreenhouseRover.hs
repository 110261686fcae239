{-# LANGUAGE LambdaCase #-}

-- |
-- The behaviour of a rover that inspects the plant beds of two greenhouses.
module GreenhouseRover
  ( Rover (..)
  , Mode (..)
  , Place (..)
  , EmergencyStopped (..)
  , rover
  ) where

import Control.Exception
  ( Exception (..)
  , IOException
  , bracket_
  , finally
  , mask_
  , throwIO
  , try
  )
import Control.Monad (forever, unless, void)
import qualified Data.Map.Strict as Map

import Beds
import Behavior
import Behavior.Parallel (firstOf, fork, scoped)
import Behavior.STM
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Time (cleanupWithin, timeout)

data Mode = Auto | Manual | Park
  deriving (Eq, Show)

data Place = AtDock House | AtBed Bed
  deriving (Eq, Show)

-- | What the behaviour needs: the hardware on the rover, a mock in a test.
data Rover = Rover
  { motorsOn, motorsOff :: Behavior ()
  , steerTo :: Place -> Behavior ()
  -- ^ Returns when the wheels have turned far enough.
  , backOff :: Behavior ()
  , joystick :: Behavior ()
  -- ^ Drives as the human operator steers, until it is cancelled.
  , position :: Signal Place
  , bumper, emergencyStop, someoneNear :: Signal Bool
  , armOut, armPark :: Behavior ()
  , camera :: Bed -> Behavior String
  -- ^ May hang, or throw an 'IOException'.
  , openDoor, closeDoor :: Behavior ()
  -- ^ The door between the houses.
  , batteryLevel :: Behavior Double
  -- ^ Percent, with noise.
  , plugIn :: House -> Behavior ()
  -- ^ Starts charging at the dock of this house. Fails when another rover is there.
  , askMode :: Behavior Mode
  -- ^ Reads the mode that the human operator has chosen, by radio. Hangs when the radio
  -- link is lost.
  , writeLog :: String -> Behavior ()
  }

-- | The failure with which the behaviour ends when the emergency stop is pressed.
data EmergencyStopped = EmergencyStopped
  deriving (Eq, Show)

instance Exception EmergencyStopped where
  toException = behaviorFailedToException
  fromException = behaviorFailedFromException

-- | Inspects the beds. However it ends, the motors are off and the arm is parked.
rover :: Rover -> Beds -> Behavior (Map.Map Bed Finding)
rover hardware beds = mission `finallyAlways` (motorsOff hardware `finally` armPark hardware)
 where
  mission =
    logging hardware $ \logged ->
      untilEmergency logged $ \permitted ->
        Signal.withShared (position hardware) $ \place ->
          Signal.withShared (Signal.hysteresis True 20 80 battery) $ \charged -> do
            let r = permitted {position = place}
            underOrders r (inMode r charged beds)
  battery = Signal.polling 0.5 (batteryLevel hardware)

-- | Ends the behaviour when the emergency stop is pressed. The motors are switched off at
-- once, before the behaviour has stopped; as the permit is taken, the behaviour cannot
-- switch them on again meanwhile.
untilEmergency :: Rover -> (Rover -> Behavior a) -> Behavior a
untilEmergency r act = do
  permit <- newTMVarIO ()
  let takeIt = atomically (takeTMVar permit)
      giveBack = atomically (putTMVar permit ())
      pressed = Signal.waitUntil (emergencyStop r) >> takeIt >> motorsOff r >> throwIO EmergencyStopped
  firstOf [pressed, act r {motorsOn = bracket_ takeIt giveBack (motorsOn r)}]

-- | Writes the log in the background: inside, 'writeLog' does not block. A log that cannot
-- be written does not end the behaviour.
logging :: Rover -> (Rover -> Behavior a) -> Behavior a
logging r act = do
  entries <- newTQueueIO
  let write line = void (tryAny (writeLog r line))
      writeRest = atomically (flushTQueue entries) >>= mapM_ write
  scoped $ \nursery -> do
    _ <- fork nursery (forever (atomically (readTQueue entries) >>= write) `finally` writeRest)
    act r {writeLog = atomically . writeTQueue entries}

-- | Runs the behaviour for the mode that the human operator has chosen. Without a radio link
-- the rover stands still until the link is back.
underOrders :: Rover -> (Mode -> Behavior a) -> Behavior a
underOrders r act = do
  -- A failure of the branch is returned as its result. So 'Left' is a failure of the signal.
  ended <- tryFailure (Signal.switch (Signal.debounce 0.8 mode) (tryFailure . act))
  case ended of
    Right result -> either throwIO pure result
    Left lost -> do
      writeLog r ("no radio link: " ++ displayException lost)
      linkIsBack
      underOrders r act
 where
  mode = Signal.staleAfter 1 (Signal.polling 0.5 (askMode r))
  linkIsBack = void (Signal.read mode) ? (sleep 1 >> linkIsBack)

tryFailure :: Behavior a -> Behavior (Either BehaviorFailed a)
tryFailure = try

inMode :: Rover -> Signal Bool -> Beds -> Mode -> Behavior (Map.Map Bed Finding)
inMode r charged beds mode = do
  writeLog r ("mode: " ++ show mode)
  case mode of
    Auto -> Signal.monitor (not <$> charged) (recharge r charged) (inspectAll r beds)
    Manual -> withMotors r (joystick r) >> forever (sleep 3600)
    Park -> drive r (AtDock North) >> forever (sleep 3600)

recharge :: Rover -> Signal Bool -> Behavior ()
recharge r charged = do
  writeLog r "recharge ..."
  fallbackOver [North, South] $ \house -> do
    drive r (AtDock house)
    plugIn r house
    timeout 600 (Signal.waitUntil charged)

-- | Inspects beds until the list is empty, including beds that are added meanwhile.
inspectAll :: Rover -> Beds -> Behavior (Map.Map Bed Finding)
inspectAll r beds =
  atomically (nextBed beds) >>= \case
    Just bed -> do
      writeLog r (show bed ++ " ...")
      inspect r beds bed `fallbackWith` \why -> do
        writeLog r (show bed ++ ": " ++ displayException why)
        atomically (settle beds bed (NotSeen (displayException why)))
      inspectAll r beds
    Nothing -> do
      drive r (AtDock North)
      closed <- atomically (closeIfEmpty beds)
      if closed then atomically (findings beds) else inspectAll r beds

inspect :: Rover -> Beds -> Bed -> Behavior ()
inspect r beds bed = do
  drive r (AtBed bed)
  (armOut r >> photograph r beds bed) `finallyAlways` armPark r

-- | Tries up to three times, with pauses.
photograph :: Rover -> Beds -> Bed -> Behavior ()
photograph r beds bed = shot ? attempt 2 (sleep 1 >> shot)
 where
  -- Nothing interrupts between taking the picture and entering it: the branch of 'timeout'
  -- does both, under one mask.
  shot = timeout 2 (mask_ (picture >>= atomically . settle beds bed . Picture))
  picture = failingOn (const True :: IOException -> Bool) (camera r bed)

-- | Drives to the place, through the door if it is in the other house.
drive :: Rover -> Place -> Behavior ()
drive r place = do
  here <- Signal.read (position r)
  unless (here == place) $
    if houseOf here == houseOf place
      then move
      else (attempt 3 openWhenAlone >> move) `finallyAlways` closeDoor r
 where
  move = timeout 60 . withMotors r . Signal.monitor (bumper r) (backOff r) $ do
    steerTo r place
    Signal.waitUntil ((== place) <$> position r)
  alone = not <$> someoneNear r
  openWhenAlone = timeout 30 (Signal.waitUntil alone) >> Signal.whileHolding alone (openDoor r)

houseOf :: Place -> House
houseOf = \case
  AtDock house -> house
  AtBed (Bed house _) -> house

withMotors :: Rover -> Behavior a -> Behavior a
withMotors r act = (motorsOn r >> act) `finallyAlways` motorsOff r

-- | 'finally' for a cleanup that takes time, such as parking the arm. Nothing must interrupt
-- it: neither the emergency stop nor the battery.
finallyAlways :: Behavior a -> Behavior () -> Behavior a
finallyAlways act cleanup = act `finally` cleanupWithin (1 / 0) cleanup
