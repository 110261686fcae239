{-# LANGUAGE LambdaCase #-}

-- |
-- What holds on each day of a fleet, whatever dies, and however the database answers.
module Fleet.Promised
  ( keptByFleets
  , complaints
  ) where

import Control.Monad (unless)
import Data.List (group, sort, tails)
import Data.Maybe (isJust)

import Behavior.Fleet
import Fleet.World
import Promises.Stage (Promise (..), broken)
import qualified Promises.Stage as Stage
import qualified Support

-- | Tasks: each that is done has written once; nothing else has written. None is started more often than it may be, and
-- it is dead only if it was started so often. Two robots never do the same at the same time, nor are they in the door
-- together; and who comes later has the greater fence. When all is well again, all tasks end.
keptByFleets :: Promise
keptByFleets =
  Promise
    { promised = "Fleets: started at least once, completed exactly once, one robot in the door"
    , programs = const worlds
    , kept = \stage world ->
        Stage.run stage (inWorld world) >>= \case
          Support.Gave report ->
            let wrong = complaints world report
             in unless (null wrong) (broken (unlines (wrong ++ [show report])))
          end -> broken ("the day ends so: " ++ show end)
    }

complaints :: World -> Report -> [String]
complaints world report =
  concat
    [ strange report
    , ["it is not over" | not (all (isOver . snd) (tasks report) && length (tasks report) == length (orders world))]
    , [key ++ " has written " ++ show (length these) ++ " times" | these@(key : _ : _) <- group (sort (written report))]
    , [key ++ " is " ++ show (taskState task) ++ ", and has written" | (key, task) <- others, key `elem` written report]
    , [key ++ " is done, and has not written" | (key, task) <- tasks report, isDone task, key `notElem` written report]
    , [key ++ " was started too often" | (key, task) <- tasks report, taskStarts task > mayStart key]
    , [key ++ " is dead too early"
      | (key, task) <- tasks report, taskState task == Dead, taskStarts task < mayStart key]
    , [show stay ++ " is not alone" | stay <- stays report, beside stay > 0]
    , [ show (one, other) ++ ": their fences"
      | one : later <- tails (filter (isJust . stayFence) (stays report))
      , other <- later
      , stayIn one == stayIn other && stayFence one >= stayFence other
      ]
    ]
 where
  others = filter (not . isDone . snd) (tasks report)
  isDone = (== Done) . taskState
  isOver = (`elem` [Done, Dead, Cancelled]) . taskState
  mayStart key = maybe 0 ((+ 1) . length . pausesBetween) (lookup key (zip (map orderKey [0 ..]) (orders world)))
