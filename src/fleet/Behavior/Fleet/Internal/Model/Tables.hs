{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The tables of the schema, as a value, and how functions change them.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Model.Tables
  ( -- * Tables
    Model (..)
  , Row (..)
  , Holder (..)
  , Waiter (..)
  , emptyModel
  , perEpoch
  , isOpen
  , isPeriodic

    -- * Functions
  , Doing
  , getting
  , change
  , put
  , nextNumberOf
  , tell
  , tellTask
  , refuse
  , requireEpoch
  , requireTerm
  , requireRobots
  ) where

import Control.Monad (unless, when)
import Control.Monad.Trans.Class (lift)
import Control.Monad.Trans.Except (ExceptT, throwE)
import Control.Monad.Trans.State.Strict (State, gets, modify')
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust)
import Data.Text (Text)
import qualified Data.Text as Text
import Data.UUID.Types (UUID)

import Behavior (Seconds)
import Behavior.Fleet.Internal.Contract

-- | The tables.
data Model = Model
  { rows :: Map TaskNumber Row
  , nextRow :: TaskNumber
  , nextNumber :: Number
  , resources :: Map Text Holder
  , places :: Map Int Waiter
  , nextPlace :: Int
  , epoch :: Int
  , isRestored :: Bool
  , seen :: Number
  -- ^ The greatest number that a client has seen of a lost database.
  , holdsFrom :: Seconds
  -- ^ No resource is free before.
  , said :: [Notice]
  -- ^ The latest first.
  }

-- | A row of the table of tasks.
data Row = Row
  { key :: Text
  , submitted :: Submission
  , due :: Seconds
  , deadline :: Maybe Seconds
  , task :: Task
  , lease :: Maybe Number
  , robot :: Text
  , term :: Seconds
  , request :: Maybe UUID
  , wakes :: Maybe Seconds
  , isCancelled :: Bool
  , isWatched :: Bool
  }

-- | The last holder of a resource.
data Holder = Holder
  { fence :: Number
  , holderRequest :: Maybe UUID
  , holderRobot :: Text
  , holderTerm :: Seconds
  , heldUntil :: Seconds
  }

-- | One that waits for resources.
data Waiter = Waiter
  { wish :: Wish
  , asked :: Seconds
  , placeUntil :: Seconds
  }

-- | After the schema was created.
emptyModel :: Model
emptyModel =
  Model
    { rows = Map.empty
    , nextRow = TaskNumber 1
    , nextNumber = perEpoch
    , resources = Map.empty
    , places = Map.empty
    , nextPlace = 1
    , epoch = 1
    , isRestored = False
    , seen = 0
    , holdsFrom = 0
    , said = []
    }

-- | Between the first numbers of two epochs.
perEpoch :: Num n => n
perEpoch = 1000000

-- | Whether a task is to come, waits or runs.
isOpen :: Row -> Bool
isOpen row = taskState (task row) `elem` [Later, Waiting, Running]

-- | Whether a task is one of a series.
isPeriodic :: Row -> Bool
isPeriodic = isJust . withPeriod . submitted

-- | What a function does: it changes all that it says, or it refuses, and changes nothing.
type Doing = ExceptT Refusal (State Model)

-- | What is there.
getting :: (Model -> a) -> Doing a
getting = lift . gets

-- | Changes it.
change :: (Model -> Model) -> Doing ()
change = lift . modify'

-- | Changes a task.
put :: TaskNumber -> Row -> Doing ()
put n row = change (\m -> m {rows = Map.insert n row (rows m)})

-- | Takes a number for a lease or a fence.
nextNumberOf :: Doing Number
nextNumberOf = getting nextNumber <* change (\m -> m {nextNumber = nextNumber m + 1})

-- | Gives a notice.
tell :: Notice -> Doing ()
tell notice = change (\m -> m {said = notice : said m})

-- | Gives a notice of this task, if it is watched.
tellTask :: TaskNumber -> Row -> Doing ()
tellTask n row = when (isWatched row) (tell (OfTask n))

-- | Refuses an argument, and says what is allowed.
refuse :: Text -> Doing a
refuse = throwE . BadArgument

-- | Refuses what would give out numbers again.
requireEpoch :: Doing ()
requireEpoch = do
  restored <- getting isRestored
  when restored . throwE $ WasRestored "this database was restored from a copy: run behavior-fleet new-epoch"

-- | Refuses a term that is not allowed.
requireTerm :: Seconds -> Doing ()
requireTerm seconds = unless (seconds >= 0.1 && seconds <= 86400) $ refuse "a term has 0.1 seconds to 1 day"

-- | Refuses names of robots that are not allowed.
requireRobots :: [Text] -> Doing ()
requireRobots names =
  unless (all (\name -> Text.length name >= 1 && Text.length name <= 200) names) $
    refuse "the name of a robot has 1 to 200 characters"
