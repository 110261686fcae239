{-# LANGUAGE LambdaCase #-}

-- |
-- A world of two doors, a room behind them, and a robot with a battery. It stands in
-- for the hardware of a real robot: in the executables its actions take time, in
-- tests they are what the test wants them to be.
--
-- What the robot can do in it has its names, those of the paper, in "Robot".
module World
  ( -- * What a world is made of
    Setting (..)
  , still
  , Door (..)
  , doorName
  , DoorState (..)
  , Condition (..)
  , World
  , newWorld
  , setting
  , doorIs
  , holds

    -- * Its time
  , clock
  , wait
  , taking

    -- * Its battery
  , batteryNow
  , setBattery
  , untilCharged
  , recharging
  , fillBattery
  , flat
  , BatteryFlat (..)

    -- * Acting in it
  , perform
  , happened
  , narrating
  ) where

import Control.Exception
  ( Exception (..)
  , SomeAsyncException
  , SomeException (..)
  , bracket_
  , catch
  , finally
  , mask
  , mask_
  , throwIO
  )
import Control.Monad (forever)
import Data.Foldable (toList, traverse_)
import Data.Sequence (Seq, (|>))
import qualified Data.Sequence as Seq
import Numeric.Natural (Natural)

import Battery
import Behavior
import Behavior.Parallel (firstOf)
import qualified Behavior.Signal as Signal
import Behavior.STM
  ( STM
  , TVar
  , atomically
  , modifyTVar'
  , newTVarIO
  , orElse
  , readTVar
  , readTVarIO
  , retry
  , writeTVar
  )
import Behavior.Time (now)
import WorldChange

-- | How a world is at first, and what holds in it.
data Setting = Setting
  { frontIs :: DoorState
  , backIs :: DoorState
  , chargedTo :: Double
  -- ^ The level of the battery: percent.
  , drain :: Double
  -- ^ What the battery loses while it is not being charged: percent a second.
  , gain :: Double
  -- ^ What it gains while it is: percent a second.
  , threshold :: Int
  -- ^ Below this level the battery is low: percent.
  , speed :: Double
  -- ^ How many seconds of the world pass in a real one.
  , lasting :: World -> String -> Behavior ()
  -- ^ How long the action of this name takes, and what else happens meanwhile. The
  -- action has its effect when this has returned; if this throws, it has none.
  }

-- | Closed doors, a full battery that does not drain, and actions that take no time.
still :: Setting
still =
  Setting
    { frontIs = Closed
    , backIs = Closed
    , chargedTo = 100
    , drain = 0
    , gain = 0
    , threshold = 10
    , speed = 1
    , lasting = \_ _ -> pure ()
    }

data Door = FrontDoor | BackDoor
  deriving (Eq, Ord, Show, Enum, Bounded)

doorName :: Door -> String
doorName = \case
  FrontDoor -> "front door"
  BackDoor -> "back door"

data DoorState
  = Open
  | Closed
  | -- | To open it fails; to smash it works.
    Locked
  | -- | So many tries to open it fail.
    Jammed Natural
  | -- | Neither works.
    Sealed
  deriving (Eq, Ord, Show)

-- | What can hold in a world, apart from what its doors and battery say.
data Condition = InsideRoom | CloseToWall | DangerNearby | C1 | C2 | C3
  deriving (Eq, Ord, Show, Enum, Bounded)

data World = World
  { setting :: Setting
  , began :: Seconds
  , doorIs :: Door -> TVar DoorState
  , holds :: Condition -> TVar Bool
  -- ^ At first no condition holds.
  , battery :: TVar Battery
  , history :: TVar (Seq WorldChange)
  }

newWorld :: Setting -> IO World
newWorld s = do
  start <- now
  front <- newTVarIO (frontIs s)
  back <- newTVarIO (backIs s)
  conditions <- traverse (const (newTVarIO False)) [minBound .. maxBound :: Condition]
  powered <- newTVarIO (withRate 0 (negate (drain s)) (charged (chargedTo s)))
  past <- newTVarIO Seq.empty
  pure
    World
      { setting = s
      , began = start
      , doorIs = \case FrontDoor -> front; BackDoor -> back
      , holds = \condition -> conditions !! fromEnum condition
      , battery = powered
      , history = past
      }

-- | The time of the world, since it began.
clock :: World -> Behavior Seconds
clock world = (\t -> (t - began world) * pace world) <$> now

-- | Waits for so many seconds of the world.
wait :: World -> Seconds -> Behavior ()
wait world seconds = sleep (seconds / pace world)

-- | For 'lasting': recharging takes until the battery is full, every other action as
-- long as this says.
taking :: Behavior Seconds -> World -> String -> Behavior ()
taking seconds world name =
  wait world =<< if name == "recharge" then untilCharged world else seconds

pace :: World -> Seconds
pace = realToFrac . speed . setting

-- | The level of the battery: percent.
batteryNow :: World -> Behavior Double
batteryNow = askBattery levelAt

-- | As if somebody had changed the battery for one of this level.
setBattery :: World -> Double -> Behavior ()
setBattery world percent = changeBattery world (`withLevel` percent)

-- | How long it takes until the battery is full, at the rate at which it now charges.
untilCharged :: World -> Behavior Seconds
untilCharged = askBattery untilFull

-- | Charges the battery while the behaviour runs.
recharging :: World -> Behavior a -> Behavior a
recharging world = bracket_ (rate (gain (setting world))) (rate (negate (drain (setting world))))
 where
  rate percentASecond = changeBattery world (`withRate` percentASecond)

-- | What recharging it comes to.
fillBattery :: World -> STM ()
fillBattery world = modifyTVar' (battery world) filled

-- | Waits until the battery is flat, and throws that.
flat :: World -> Behavior a
flat world = Signal.switch (Signal.watching (readTVar (battery world))) $ \b -> do
  t <- clock world
  wait world (lasts t b)
  throwIO BatteryFlat

-- | A fault of the world: nothing that a robot could recover from.
data BatteryFlat = BatteryFlat
  deriving (Eq, Show)

instance Exception BatteryFlat where
  displayException BatteryFlat = "the battery is flat"

askBattery :: (Seconds -> Battery -> a) -> World -> Behavior a
askBattery question world =
  question <$> clock world <*> readTVarIO (battery world)

changeBattery :: World -> (Seconds -> Battery -> Battery) -> Behavior ()
changeBattery world change =
  clock world >>= \t -> atomically (modifyTVar' (battery world) (change t))

-- | All that the robot does goes through here: the action begins, lasts as long as
-- the world says, and then has its effect, or fails for the reason that the effect
-- gives (what that has changed stays changed).
perform :: World -> String -> STM (Either String a) -> Behavior a
perform world name effect = mask $ \restore -> do
  record world name (const Begins) (pure ())
  restore (lasting (setting world) world name) `catch` \e -> do
    record world name (const (unfinished e)) (pure ())
    throwIO e
  -- One transaction, and masked: it has been done if and only if it is on record.
  record world name (either Fails (const Done)) effect >>= either failWith pure

-- | Puts what a transaction did to an action on record.
record :: World -> String -> (a -> ChangeKind) -> STM a -> Behavior a
record world name how effect = do
  t <- clock world
  atomically $ do
    result <- effect
    percent <- levelAt t <$> readTVar (battery world)
    modifyTVar' (history world) (|> WorldChange t percent name (how result))
    pure result

unfinished :: SomeException -> ChangeKind
unfinished e@(SomeException inner)
  | Just failure <- fromException e = Fails (displayException (failure :: BehaviorFailed))
  | Just cancellation <- fromException e = interrupted cancellation
  | otherwise = Faults (displayException inner)
 where
  interrupted :: SomeAsyncException -> ChangeKind
  interrupted _ = Interrupted

-- | What has happened, from the beginning.
happened :: World -> Behavior [WorldChange]
happened world = toList <$> readTVarIO (history world)

-- | Tells every event while the behaviour runs, and has told all when it ends. The
-- robot does not wait for the telling.
narrating :: World -> (WorldChange -> Behavior ()) -> Behavior a -> Behavior a
narrating world tell act = do
  told <- newTVarIO 0
  let next = do
        n <- readTVar told
        event <- readTVar (history world) >>= maybe retry pure . Seq.lookup n
        event <$ writeTVar told (n + 1)
      -- Masked: an event that was taken is told.
      telling = forever (mask_ (atomically next >>= tell))
      others = atomically ((Just <$> next) `orElse` pure Nothing) >>= traverse_ (\e -> tell e >> others)
  firstOf [act, telling] `finally` others
