{-# LANGUAGE LambdaCase #-}

-- |
-- The changes of an action of the robot.
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
  | -- | It was cancelled, and has stopped.
    Interrupted
  | -- | Something else went wrong.
    Faults String
  deriving (Eq, Show)

-- | A change as one line of a report.
describe :: WorldChange -> String
describe change = line (time change) (charge change) (action change ++ ending (changeKind change))
 where
  ending = \case
    Begins -> " ..."
    Done -> ": done"
    Fails why -> ": failed, " ++ why
    Interrupted -> ": interrupted, motors off"
    Faults what -> ": fault, " ++ what

-- | A line of a report: the time, the charge of the battery, and a text.
line :: Seconds -> Double -> String -> String
line t percent what = column 7 seconds ++ " s  " ++ column 3 level ++ " %  " ++ what
 where
  seconds = showFFloat (Just 1) (realToFrac t :: Double) ""
  level = show (wholePercent percent)
  column width text = replicate (width - length text) ' ' ++ text
