{-# LANGUAGE LambdaCase #-}

-- |
-- What can happen to an action of the robot.
module WorldChange
  ( WorldChange (..)
  , ChangeKind (..)
  , describe
  , line
  ) where

import Numeric (showFFloat)

import Battery (wholePercent)
import Behavior (Seconds)

data WorldChange = WorldChange
  { time :: Seconds
  -- ^ Since the world began.
  , charge :: Double
  -- ^ Of the battery, percent.
  , action :: String
  , changeKind :: ChangeKind
  }
  deriving (Eq, Show)

data ChangeKind
  = Begins
  | Done
  | -- | It could not be done, for this reason.
    Fails String
  | -- | Somebody no longer wanted it, and it has stopped what it was doing.
    Interrupted
  | -- | Something else went wrong.
    Faults String
  deriving (Eq, Show)

-- | An event as one line of a report.
describe :: WorldChange -> String
describe event = line (time event) (charge event) (action event ++ ending (changeKind event))
 where
  ending = \case
    Begins -> " ..."
    Done -> ": done"
    Fails why -> ": failed, " ++ why
    Interrupted -> ": interrupted, motors off"
    Faults what -> ": fault, " ++ what

-- | A line of a report: the time, the charge of the battery, and what there is to say.
line :: Seconds -> Double -> String -> String
line t percent what = column 7 seconds ++ " s  " ++ column 3 level ++ " %  " ++ what
 where
  seconds = showFFloat (Just 1) (realToFrac t :: Double) ""
  level = show (wholePercent percent)
  column width text = replicate (width - length text) ' ' ++ text
