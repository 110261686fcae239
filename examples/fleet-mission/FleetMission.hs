{-# LANGUAGE DeriveGeneric #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- Robots that carry orders from their shelves to the hall, and share two doors and four chargers. Each order is
-- delivered once, whatever happens to the robots, to their processes or to the database.
module FleetMission
  ( Order (..)
  , Place
  , Body (..)
  , mission
  , office
  , inTable
  ) where

import Control.Exception (onException)
import Control.Monad (forM, forM_, void)
import Data.Aeson (FromJSON, ToJSON)
import Database.PostgreSQL.Simple (execute)
import GHC.Generics (Generic)

import Behavior
import Behavior.Fleet
import Behavior.STM
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Time (cleanupWithin, retrying, sleepForever)
import Behavior.Trace (named)

data Order = Order
  { number :: Int
  , isHeavy :: Bool
  }
  deriving (Eq, Generic, Show)

instance FromJSON Order
instance ToJSON Order

-- | A door or a charger, which one robot uses at a time.
type Place = String

orders :: Queue Order ()
orders = queue "orders"

-- | The hardware of one robot. @main@ fills this record with a simulated robot, and so does a test.
data Body = Body
  { pickUp, carry, putDown :: Order -> Behavior ()
  , passThrough, chargeAt :: Place -> Fence -> Behavior ()
  , backOut :: Place -> Behavior ()
  -- ^ In less than 0.9 s.
  , nearestFirst :: [Place] -> Behavior [Place]
  , battery :: Signal Double
  -- ^ From 0 to 100.
  , lamp :: Bool -> Behavior ()
  -- ^ Shows whether the fleet's database is there.
  , delivered :: Order -> Commit ()
  -- ^ Writes that it is.
  }

-- | Carries one order after the other.
mission :: Fleet -> Body -> Behavior ()
mission fleet body = light ||| serving fleet orders (deliver fleet body)
 where
  light = Signal.rSelect (databaseUp fleet) (lamp body True >> sleepForever) (lamp body False >> sleepForever)

-- | When the battery is low the robot recharges, and then goes on where it was. In the end it does not write that the
-- order is delivered: it returns what is to be written. That is written in the transaction that completes the task.
-- (If a door or a charger is lost, because the database was away for too long, this start of the task has failed.)
deliver :: Fleet -> Body -> Order -> Behavior (Commit ())
deliver fleet body order = failingOn isLeaseLost $ do
  steps <- newTVarIO [pickUp body order, enter, carry body order, putDown body order]
  Signal.monitor (Signal.named "battery low" ((< 30) <$> battery body)) recharge (resumable steps id)
  pure (delivered body order)
 where
  enter = again (through "north door" ? through "south door")
  through door = soon fleet body door (passThrough body door)
  recharge = named "recharge" $ do
    nearest <- nearestFirst body ["charger " ++ show n | n <- [1 .. 4 :: Int]]
    again (fallbackOver nearest (\charger -> soon fleet body charger (chargeAt body charger)))
  again = retrying (repeat 0.1)

-- | Uses a door or a charger. Fails if that does not become free within half a second. A robot that is interrupted in
-- it (its battery is low, its lease is lost) backs out before it is given back, in less than a third of the term.
soon :: Fleet -> Body -> Place -> (Fence -> Behavior ()) -> Behavior ()
soon fleet body place use =
  holdingWithin 0.5 fleet (resource place) 3 $ \fence ->
    use fence `onException` cleanupWithin 0.9 (backOut body place)

-- | Submits orders, waits until all have ended, and gives those that failed as often as they may. (An office that is
-- started again submits nothing twice.)
office :: Fleet -> [Order] -> Behavior [(String, Task)]
office fleet wanted = do
  tickets <- forM wanted $ \order ->
    submitWith (chosen order) fleet orders ("order " ++ show (number order)) order
  forM_ tickets $ \ticket -> watchingTask fleet ticket $ \task ->
    Signal.waitUntil ((`elem` [Done, Dead, Cancelled]) . taskState <$> task)
  deadTasks fleet orders
 where
  chosen order =
    defaultSubmitOptions
      { taskNeeds = ["lift" | isHeavy order]
      , taskPauses = [0.5, 0.5, 1, 1, 2, 2]
      }

-- | In the table of delivered.sql.
inTable :: String -> Order -> Commit ()
inTable robot order = writing $ \connection ->
  void (execute connection "insert into delivered (number, robot) values (?, ?)" (number order, robot))
