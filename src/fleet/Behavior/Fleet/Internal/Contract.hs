{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE GADTs #-}
{-# LANGUAGE GeneralizedNewtypeDeriving #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- What a fleet asks of its database: the functions of the schema.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Contract
  ( Request (..)
  , askedAgain
  , Refusal (..)

    -- * Tasks
  , TaskNumber (..)
  , Number (..)
  , Submission (..)
  , Claiming (..)
  , Start (..)
  , Became (..)
  , TaskState (..)
  , Task (..)

    -- * Resources
  , Wish (..)
  , Held (..)

    -- * Processes
  , Presence (..)

    -- * Notices
  , Notice (..)
  ) where

import Data.Aeson (Value)
import Data.Int (Int64)
import Data.Set (Set)
import Data.Text (Text)
import Data.UUID.Types (UUID)

import Behavior (Seconds)

-- | One function of the schema with its arguments, and the type of what it gives.
data Request r where
  -- | The greatest number that this process has seen; gives the version of the schema, and the epoch.
  Connect :: Number -> Request (Int, Int)
  Submit :: Submission -> Request TaskNumber
  Claim :: Claiming -> Request [Start]
  -- | Those that keep their leases, and whether they are to be cancelled.
  Renew :: [(TaskNumber, Number)] -> Request [(TaskNumber, Number, Bool)]
  -- | Those that are completed now.
  Complete :: [(TaskNumber, Number, Value)] -> Request [(TaskNumber, Number)]
  -- | Both, in one statement.
  CompleteAndClaim :: [(TaskNumber, Number, Value)] -> Claiming -> Request ([(TaskNumber, Number)], [Start])
  Fail :: TaskNumber -> Number -> Text -> Request ()
  GiveBack :: TaskNumber -> Number -> Request ()
  Report :: TaskNumber -> Number -> Value -> Request ()
  Became :: TaskNumber -> Number -> Request Became
  Look :: [TaskNumber] -> Request [(TaskNumber, Task)]
  -- | By queue and key, as the two after it.
  Find :: Text -> Text -> Request (Maybe TaskNumber)
  Cancel :: Text -> Text -> Request (Maybe TaskState)
  Retry :: Text -> Text -> Request Bool
  -- | Those of a queue that are dead, with their keys, the oldest first.
  ListDead :: Text -> Request [(Text, Task)]
  Hold :: Wish -> Request Held
  -- | Those that keep what they hold.
  Keep :: [UUID] -> Request [UUID]
  Release :: UUID -> Request ()
  -- | Gives when the clock will make something due, and the queues in which tasks wait.
  Poll :: Presence -> Request (Maybe Seconds, [Text])
  Leave :: UUID -> Request ()

-- | The same, if it is not known what was answered. (Each of the others may simply be asked again.)
askedAgain :: Request r -> Request r
askedAgain = \case
  Claim it -> Claim it {isAgain = True}
  CompleteAndClaim ends it -> CompleteAndClaim ends it {isAgain = True}
  asked -> asked

-- | Why the database has not done it. (The connection is as good as before.)
data Refusal
  = -- | The lease is lost.
    LeaseGone
  | -- | An argument is not allowed, and why.
    BadArgument Text
  | -- | The database was restored from a copy; what it says about that.
    WasRestored Text
  | -- | It has no fleet of this library, or this user may not use it, and what is to be done.
    NoFleet Text
  | -- | A lock was not free in time: to be asked again.
    Busy
  deriving (Eq, Show)

-- | The database's number of a task.
newtype TaskNumber = TaskNumber Int64
  deriving (Eq, Ord, Show)

-- | Of a lease or a fence: it only grows.
newtype Number = Number Int64
  deriving (Enum, Eq, Integral, Num, Ord, Real, Show)

-- | A task, for the database.
data Submission = Submission
  { toQueue :: Text
  , withKey :: Text
  , taskInput :: Value
  , withPriority :: Int
  , notBefore :: Maybe Seconds
  , notAfter :: Maybe Seconds
  , withNeeds :: Set Text
  , withPeriod :: Maybe Seconds
  , withPauses :: [Seconds]
  , keptFor :: Seconds
  }
  deriving (Eq, Show)

-- | The robots that are free, all with the same skills.
data Claiming = Claiming
  { fromQueue :: Text
  , forRobots :: [Text]
  , withSkills :: Set Text
  , forTerm :: Seconds
  , claimNumber :: UUID
  , isAgain :: Bool
  -- ^ It is not known what was answered: the same starts again, if there were some.
  }
  deriving (Eq, Show)

-- | A start of a task.
data Start = Start
  { startTask :: TaskNumber
  , startLease :: Number
  , startRobot :: Text
  , startKey :: Text
  , startInput :: Value
  , startCount :: Int
  -- ^ 1 at the first start.
  }
  deriving (Eq, Show)

-- | What became of a start.
data Became = StillRuns | IsCompleted | IsLost
  deriving (Eq, Show)

-- | The state of a task.
--
-- @since 0.1.0.0
data TaskState
  = -- | Its time has not come; or it has failed, and pauses.
    Later
  | Waiting
  | Running
  | Done
  | -- | It has failed as often as it may, or its deadline has passed.
    Dead
  | Cancelled
  deriving (Bounded, Enum, Eq, Ord, Show)

-- | What is known of a task.
--
-- @since 0.1.0.0
data Task = Task
  { taskState :: TaskState
  , taskStarts :: Int
  , taskProgress :: Maybe Value
  , taskResult :: Maybe Value
  , taskReasons :: [String]
  -- ^ Why its starts failed.
  }
  deriving (Eq, Show)

-- | All of these resources, or none.
data Wish = Wish
  { wishNumber :: UUID
  , wishFor :: Set Text
  , wishRobot :: Text
  , wishTerm :: Seconds
  }
  deriving (Eq, Show)

-- | The fence of each resource; or when to ask again.
data Held
  = Holds [(Text, Number)]
  | AskAgainIn Seconds
  deriving (Eq, Show)

-- | What a process says of itself.
data Presence = Presence
  { process :: UUID
  , itsPage :: Maybe Text
  , itsRobots :: [Text]
  , everySeconds :: Seconds
  }
  deriving (Eq, Show)

-- | What changed: a hint, on which nothing depends.
data Notice
  = OfQueue Text
  | -- | A task of which the time has not come.
    OfLater
  | OfTask TaskNumber
  | OfCancel TaskNumber
  | -- | A resource is free, and it is not known whose turn it is.
    OfResource Text
  | -- | The turn of a request that waits for resources.
    OfTurn UUID
  | -- | It is some request's turn to have this resource.
    OfLine Text
  | -- | Notices may have been missed.
    OfAnything
  deriving (Eq, Ord, Show)
