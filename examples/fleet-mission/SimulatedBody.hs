-- |
-- A simulated robot: what it does takes time and drains its battery, and now and then a parcel slips.
module SimulatedBody
  ( newBody
  ) where

import Control.Exception (ErrorCall (..), throwIO)
import Control.Monad (forever, when)
import Data.Char (ord)

import Behavior
import Behavior.Fleet
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Trace (named)
import FleetMission

-- | A robot of that name. Its time passes the given number of times faster; a second of work takes that much of its
-- battery, which has 100; and it says what a reader is to know.
newBody :: Double -> Double -> (String -> Behavior ()) -> String -> (Order -> Commit ()) -> IO Body
newBody speed rate say name writes = do
  level <- newTVarIO 100
  -- (Robots differ: in what is near, and when a parcel slips.)
  grips <- newTVarIO (sum (map ord name))
  let lasting seconds = realToFrac (seconds / speed) :: Seconds
      action what seconds = named what (sleep (lasting seconds) ||| forever (sleep (lasting 1) >> drain level rate))
  pure
    Body
      { pickUp = \order -> do
          n <- atomically (stateTVar grips (\n -> (n, n + 1)))
          action "pick up" 4
          when (number order == emptyShelf) $ failWith ("shelf " ++ show emptyShelf ++ " is empty")
          when (n `mod` 15 == 0) $ failWith "the parcel slips"
      , carry = \_ -> action "carry" 20
      , putDown = \_ -> action "put down" 1
      , passThrough = \door _ -> action ("pass through " ++ door) 2
      , backOut = \place -> action ("back out of " ++ place) 0.5
      , chargeAt = \charger _ -> named charger (sleep (lasting 20) >> atomically (writeTVar level 100))
      , nearestFirst = \these -> do
          n <- (`mod` length these) <$> readTVarIO grips
          pure (drop n these ++ take n these)
      , battery = Signal.named "battery" (Signal.watching (readTVar level))
      , lamp = \isThere -> say (if isThere then "the database is there" else "the database is away")
      , delivered = writes
      }
 where
  emptyShelf = 13

drain :: TVar Double -> Double -> Behavior ()
drain level amount = do
  left <- atomically (stateTVar level (\n -> (n - amount, n - amount)))
  when (left <= 0) $ throwIO (ErrorCall "the battery is flat")
