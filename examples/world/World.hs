{-# LANGUAGE LambdaCase #-}

-- |
-- A world of two doors, a room behind them, and a robot with a battery. It stands in
-- for the hardware of a real robot: in the executables its actions take time, and in
-- tests what the test wants.
--
-- What the robot can do in it is in "Robot", by the names that the paper uses.
module World
  ( -- * What a world is made of
    World
  , setting
  , newWorld
  , Setting (..)
  , still
  , Door (..)
  , doorName
  , DoorState (..)
  , Condition (..)

    -- * Its variables
  , doorIs
  , holds
  , charge
  , chargeNow
  , setCharge

    -- * Its time
  , clock
  , wait

    -- * Acting in it
  , perform
  , charging
  , fillUp
  , untilCharged
  , flat
  , BatteryFlat (..)

    -- * What has happened
  , Event (..)
  , Happening (..)
  , happened
  , describe
  , narrating
  ) where

import Control.Concurrent.STM (STM, TVar, modifyTVar', newTVarIO, orElse, readTVar, retry, writeTVar)
import Control.Exception
  ( Exception (..)
  , SomeAsyncException
  , SomeException
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
import Numeric (showFFloat)
import Numeric.Natural (Natural)

import Battery
import Behavior
import Behavior.Parallel (firstOf)
import qualified Behavior.Signal as Signal
import Behavior.Time (atomically, now)

-- | How a world is at first, and what holds in it.
data Setting = Setting
  { frontIs :: DoorState
  , backIs :: DoorState
  , chargeIs :: Double
  -- ^ Percent.
  , drain :: Double
  -- ^ What the battery loses while it is not being charged: percent a second.
  , chargeRate :: Double
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
    , chargeIs = 100
    , drain = 0
    , chargeRate = 0
    , threshold = 10
    , speed = 1
    , lasting = \_ _ -> pure ()
    }

data World = World
  { setting :: Setting
  , began :: Seconds
  , doorIs :: Door -> TVar DoorState
  , holds :: Condition -> TVar Bool
  -- ^ At first no condition holds.
  , charge :: TVar Battery
  , history :: TVar (Seq Event)
  }

newWorld :: Setting -> IO World
newWorld s = do
  front <- newTVarIO (frontIs s)
  back <- newTVarIO (backIs s)
  conditions <- traverse (const (newTVarIO False)) [minBound .. maxBound :: Condition]
  t <- now
  World s t
    (\case FrontDoor -> front; BackDoor -> back)
    (\condition -> conditions !! fromEnum condition)
    <$> newTVarIO (withRate 0 (negate (drain s)) (battery (chargeIs s)))
    <*> newTVarIO Seq.empty

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
  | -- | So many more tries to open it fail.
    Jammed Natural
  | -- | Neither works.
    Sealed
  deriving (Eq, Ord, Show)

-- | What can hold in a world, apart from its doors and battery.
data Condition = InsideRoom | CloseToWall | DangerNearby | C1 | C2 | C3
  deriving (Eq, Ord, Show, Enum, Bounded)

-- | The level of the battery: percent.
chargeNow :: World -> Behavior Double
chargeNow world = clock world >>= \t -> levelAt t <$> atomically (readTVar (charge world))

setCharge :: World -> Double -> Behavior ()
setCharge world percent = changeCharge world (`withLevel` percent)

changeCharge :: World -> (Seconds -> Battery -> Battery) -> Behavior ()
changeCharge world change = clock world >>= \t -> atomically (modifyTVar' (charge world) (change t))

-- | The time of the world, since it began.
clock :: World -> Behavior Seconds
clock world = (\t -> (t - began world) * rate world) <$> now

-- | Waits for so many seconds of the world.
wait :: World -> Seconds -> Behavior ()
wait world seconds = sleep (seconds / rate world)

rate :: World -> Seconds
rate = realToFrac . speed . setting

-- | All that the robot does goes through here: the action begins, lasts as long as
-- the world says, and then has its effect, or fails for the reason that the effect
-- gives (what that has changed stays changed).
perform :: World -> String -> STM (Either String a) -> Behavior a
perform world action effect = mask $ \restore -> do
  record world action Begins (pure ())
  restore (lasting (setting world) world action) `catch` \e -> do
    record world action (unfinished e) (pure ())
    throwIO e
  -- Masked, and in one transaction: whoever reads that it is done finds it done.
  result <- recordThat world action (either Fails (const Done)) effect
  either failWith pure result

unfinished :: SomeException -> Happening
unfinished e
  | Just failure <- fromException e = Fails (displayException (failure :: BehaviorFailed))
  | Just cancellation <- fromException e = const Interrupted (cancellation :: SomeAsyncException)
  | otherwise = Faults (displayException e)
