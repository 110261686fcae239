{-# LANGUAGE LambdaCase #-}

-- |
-- A world of two doors, a room behind them, and a robot with a battery. It takes the
-- place of the hardware of a real robot: in the executables its actions take time, in
-- tests the test defines what they do.
--
-- "Robot" defines the robot's actions, with the names of the paper.
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
import Behavior.Trace (named)
import WorldChange

-- | The initial state of a world, and its constants.
data Setting = Setting
  { frontIs :: DoorState
  , backIs :: DoorState
  , chargedTo :: Double
  -- ^ The level of the battery: percent.
  , drain :: Double
  -- ^ How fast the battery drains while it is not being charged: percent per second.
  , gain :: Double
  -- ^ How fast it fills while it is being charged: percent per second.
  , threshold :: Int
  -- ^ Below this level the battery is low: percent.
  , speed :: Double
  -- ^ How many seconds of the world pass in a real second.
  , lasting :: World -> String -> Behavior ()
  -- ^ Runs for as long as the action of this name takes. The action has its effect when
  -- this has returned; if this throws, the action has no effect.
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
  | -- | Opening it fails; smashing it works.
    Locked
  | -- | This number of tries to open it fail.
    Jammed Natural
  | -- | Neither works.
    Sealed
  deriving (Eq, Ord, Show)

-- | The conditions of a world, apart from those of its doors and battery.
data Condition = InsideRoom | CloseToWall | DangerNearby | C1 | C2 | C3
  deriving (Eq, Ord, Show, Enum, Bounded)

data World = World
  { setting :: Setting
  , began :: Seconds
  , doorIs :: Door -> TVar DoorState
  , holds :: Condition -> TVar Bool
  -- ^ Initially no condition holds.
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

-- | The time of the world, in seconds since it began.
clock :: World -> Behavior Seconds
clock world = (\t -> (t - began world) * pace world) <$> now

-- | Waits for the given number of seconds of the world.
wait :: World -> Seconds -> Behavior ()
wait world seconds = sleep (seconds / pace world)

-- | For 'lasting': recharging takes until the battery is full, every other action the
-- given time.
taking :: Behavior Seconds -> World -> String -> Behavior ()
taking seconds world name =
  wait world =<< if name == "recharge" then untilCharged world else seconds

pace :: World -> Seconds
pace = realToFrac . speed . setting

-- | The level of the battery: percent.
batteryNow :: World -> Behavior Double
batteryNow = readBattery levelAt

-- | Replaces the battery by one with this level.
setBattery :: World -> Double -> Behavior ()
setBattery world percent = changeBattery world (`withLevel` percent)

-- | How long it takes until the battery is full, at the rate at which it now charges.
untilCharged :: World -> Behavior Seconds
untilCharged = readBattery untilFull

-- | Charges the battery while the behaviour runs.
recharging :: World -> Behavior a -> Behavior a
recharging world = bracket_ (rate (gain (setting world))) (rate (negate (drain (setting world))))
 where
  rate percentASecond = changeBattery world (`withRate` percentASecond)

-- | The effect of recharging.
fillBattery :: World -> STM ()
fillBattery world = modifyTVar' (battery world) filled

-- | Waits until the battery is flat, then throws 'BatteryFlat'. (It is written without a signal: a trace shows
-- how the robot reacts, and not the world.)
flat :: World -> Behavior a
flat world = readTVarIO (battery world) >>= unlessItChanges
 where
  unlessItChanges b = do
    t <- clock world
    firstOf [wait world (lasts t b) >> throwIO BatteryFlat, otherThan b] >>= unlessItChanges
  otherThan b = atomically (readTVar (battery world) >>= \new -> if new == b then retry else pure new)

-- | A fault of the world, which the robot cannot recover from.
data BatteryFlat = BatteryFlat
  deriving (Eq, Show)

instance Exception BatteryFlat where
  displayException BatteryFlat = "the battery is flat"

readBattery :: (Seconds -> Battery -> a) -> World -> Behavior a
readBattery property world =
  property <$> clock world <*> readTVarIO (battery world)

changeBattery :: World -> (Seconds -> Battery -> Battery) -> Behavior ()
changeBattery world change =
  clock world >>= \t -> atomically (modifyTVar' (battery world) (change t))

-- | Performs an action; every action of the robot uses this. The action begins, lasts for
-- the time that the world defines, and then has its effect, or fails with the reason that
-- the effect returns (changes that the effect has made remain).
perform :: World -> String -> STM (Either String a) -> Behavior a
perform world name effect = named name $ mask $ \restore -> do
  record world name (const Begins) (pure ())
  restore (lasting (setting world) world name) `catch` \e -> do
    record world name (const (unfinished e)) (pure ())
    throwIO e
  -- One transaction, and masked: the effect was done if and only if it is recorded.
  record world name (either Fails (const Done)) effect >>= either failWith pure

-- | Runs a transaction and adds a change to the history, atomically.
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

-- | Passes every change to the given function while the behaviour runs, and all remaining
-- ones before it ends. The robot does not wait for that function.
narrating :: World -> (WorldChange -> Behavior ()) -> Behavior a -> Behavior a
narrating world receive act = do
  received <- newTVarIO 0
  let next = do
        n <- readTVar received
        change <- readTVar (history world) >>= maybe retry pure . Seq.lookup n
        change <$ writeTVar received (n + 1)
      -- Masked: a change that was taken is passed on.
      passing = forever (mask_ (atomically next >>= receive))
      others = atomically ((Just <$> next) `orElse` pure Nothing) >>= traverse_ (\change -> receive change >> others)
  firstOf [act, passing] `finally` others
