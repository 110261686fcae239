{-# LANGUAGE LambdaCase #-}

-- |
-- What holds of each mission of a robot, whatever the robot does, and whatever happens to its link. The robot's own
-- record is the judge.
module Ros.Promised (keptByMissions) where

import Control.Monad (unless)
import Data.Aeson (Value (..))
import Data.List (tails)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (isNothing)

import Behavior
import Behavior.Ros
import Behavior.Ros.Fake (Seen (..))
import Promises.Stage (Promise (..), broken)
import qualified Promises.Stage as Stage
import Ros.Mission
import qualified Support

-- | Structured: a goal that was stopped, or whose result came, has ended on the robot; never both: no two goals run at
-- once. But for those that end with one of two faults ('mayStillRun'): these are counted, and the next goal on their
-- action is refused meanwhile. Completed results are kept: each goal ends when it ends on the robot, and as it ended
-- there.
keptByMissions :: Promise
keptByMissions =
  Promise
    { promised = "Missions of robots: one goal at a time, each ends as the robot says"
    , programs = const worlds
    , kept = \stage world ->
        Stage.run stage (inWorld world) >>= \case
          Support.Gave report ->
            let wrong = complaints world report
            in unless (null wrong) . broken . unlines $
                wrong ++ map show (leaves report) ++ map show (came report) ++ map show (happened report)
          end -> broken ("the missions end so: " ++ show end)
    }

complaints :: World -> Report -> [String]
complaints world report =
  concat
    [ [show n ++ " is sent twice" | n : more <- tails numbers, n `elem` more]
    , -- (In the order in which they were sent: a serial bridge may pass on the later one before the earlier one.)
      [show (n, m) ++ " run at once" | (n, m) <- atOnce goals, not (allowed (leafOf (min n m)) (leafOf (max n m)))]
    , concatMap (wrongIn world report goals) (leaves report)
    , [show n ++ " is left running" | g <- leftRunning report, n <- ofNumber g, not (any mayStillRun (leafOf n))]
    , ["it is not known that all goals have ended: " ++ show (unsettled report) | unsettled report > length unheard]
    ]
 where
  goals = foldl recorded Map.empty (came report)
  numbers = [truncate n | (_, GoalCame _ _ (Number n)) <- came report] :: [Int]
  leafOf n = Map.lookup n (Map.fromList [(order l, l) | l <- leaves report])
  ofNumber g = [n | (n, Recorded {number = k}) <- Map.toList goals, g == k]
  -- (A server that never accepted a goal has never said anything about its goals.)
  unheard = [l | l <- leaves report, mayStillRun l, actionOf l `notElem` heard]
  heard = [actionOf l | (n, g) <- Map.toList goals, fmap snd (endedAt g) /= Just 0, Just l <- [leafOf n]]
  -- Beside a goal that may still run: one on another action, or one that replaces it.
  allowed (Just one) (Just two) = mayStillRun one && (actionOf one /= actionOf two || isReplacing (actionOf two))
  allowed _ _ = False

-- | The two faults with which a goal may still run.
mayStillRun :: Leaf -> Bool
mayStillRun l = case outcome l of
  FaultedWith (NotConfirmed _ _) -> True
  FaultedWith (LinkLost _ _) -> True
  _ -> False

-- | A goal, as the robot has recorded it.
data Recorded = Recorded
  { number :: Int
  , cameAt :: Seconds
  , cancelledAt :: [Seconds]
  , endedAt :: Maybe (Seconds, Int)
  , beside :: [Int]
  -- ^ Those that ran when it came.
  }

-- | The goals by what is to be done.
recorded :: Map Int Recorded -> (Seconds, Seen) -> Map Int Recorded
recorded goals (time, event) = case event of
  GoalCame k _ (Number n) ->
    Map.insert (truncate n) (Recorded k time [] Nothing [m | (m, g) <- Map.toList goals, isNothing (endedAt g)]) goals
  CancelCame k _ -> change k (\g -> g {cancelledAt = cancelledAt g ++ [time]})
  GoalEnded k status -> change k (\g -> g {endedAt = Just (time, status)})
  _ -> goals
 where
  change k f = Map.map (\g -> if number g == k then f g else g) goals

-- | Which ran when another one came.
atOnce :: Map Int Recorded -> [(Int, Int)]
atOnce goals = [(m, n) | (n, g) <- Map.toList goals, m <- beside g]

-- | What is wrong with one goal.
wrongIn :: World -> Report -> Map Int Recorded -> Leaf -> [String]
wrongIn world report goals l =
  [show (order l) ++ ": " ++ why | (why, True) <- always ++ maybe notThere there found]
 where
  found = Map.lookup (order l) goals
  always =
    [ ("it has ended, and runs on", isRunning && not (mayStillRun l))
    , ("more goals run when it is over than may still run, as far as is known", length (runningThen l) > movingThen l)
    , ("it begins while the level is not high", isGuarded l && isWrong (begun l))
    , ("it is refused, and none may still run", isRefused && not (any before (leaves report)))
    , ("no link was lost then", isLost && not (any (lostAt (over l)) (happened report)))
    , ("an error", isOther)
    ]
  isRunning = or [number g `elem` runningThen l | Just g <- [found]]
  before other = mayStillRun other && actionOf other == actionOf l && over other <= begun l
  (isRefused, isLost, isOther, hasResult) = case outcome l of
    Completed _ -> (False, False, False, True)
    FailedWith (StillMoving _) -> (True, False, False, False)
    FailedWith (NoServer _ _) -> (False, False, False, False)
    FailedWith _ -> (False, False, False, True)
    FaultedWith (LinkLost _ _) -> (False, True, False, False)
    FaultedWith (NotConfirmed _ _) -> (False, False, False, False)
    FaultedWith _ -> (False, False, True, False)
    Stopped -> (False, False, False, False)
    Otherwise _ -> (False, False, True, False)
  notThere = [("it has a result, and did not come to the robot", hasResult)]
  there g =
    [ ("it did not end as it did on the robot", not (agrees (snd <$> endedAt g)))
    , ("it did not end when it did on the robot", not (mayStillRun l || fmap fst (endedAt g) `isAbout` over l))
    , ("it was not stopped when the level was not high", isGuarded l && any (missed g) falls)
    , ("it came when its behaviour was over", not (serial world) && over l `isBefore` cameAt g)
    , ("it was cancelled, and has completed", hasCompleted && not (null (cancelledAt g)))
    , ("it did not notice that the link was lost", any (outlives g) (happened report))
    , ("its stop would have been confirmed", isNotConfirmed && wouldConfirm g)
    ]
  agrees status = case outcome l of
    Completed value -> status == Just 4 && value == Number (fromIntegral (order l))
    FailedWith (Aborted _ _) -> status == Just 6
    FailedWith (CancelledByOther _) -> status == Just 5
    FailedWith (Rejected _ _) -> status == Just 0
    FailedWith _ -> False
    _ -> True
  hasCompleted = case outcome l of
    Completed _ -> True
    _ -> False
  isNotConfirmed = case outcome l of
    FaultedWith (NotConfirmed _ _) -> True
    _ -> False
  -- Cancels come at once; one that comes after it was accepted, at most 0.2 s later.
  wouldConfirm g = case cancelledAt g of
    first : _ | not (serial world || any (isFrozen . (first +)) [0, patienceHere / 2, patienceHere]) ->
      let accepted = cameAt g + seconds (accepts plan)
          byItself = accepted + seconds (lasts plan)
          confirmed = maybe (1 / 0) (\n -> max accepted first + 0.2 + seconds n) (confirms plan)
      in min byItself confirmed < first + patienceHere - 0.001
    [] -> not (serial world || isFrozen (over l) || isFrozen (over l - patienceHere))
    _ -> False
  plan = planOf world (order l)
  outlives g (time, what) = case what of
    Loses _ -> cameAt g `isBefore` time && time `isBefore` over l
    Freezes _ -> cameAt g `isBefore` time && (time + lostAfter) `isBefore` over l
    Charge _ -> False
  missed g time = begun l `isBefore` time && time `isBefore` over l && not (any (<= time + 0.001) (cancelledAt g))
  levels = [(time, level) | (time, Charge level) <- reverse (happened report)]
  falls = [time | (time, level) <- levels, level /= High, isWrong time, not (serial world)]
  -- Whether no level that counts at that time is high. (If it has just changed, the one before counts, too.)
  isWrong time = not (isFrozen time) && notElem High (lastBefore time ++ atThe time)
  lastBefore time = take 1 (reverse [level | (t, level) <- levels, t `isBefore` time])
  atThe time = [level | (t, level) <- levels, Just t `isAbout` time]
  isFrozen time = or
    [time >= t - 0.001 && time <= t + lostAfter + seconds n + 0.001 | (t, Freezes n) <- happened report]

-- | Whether a link can have been lost at that time because of that.
lostAt :: Seconds -> (Seconds, Happening) -> Bool
lostAt time (t, what) = case what of
  Loses _ -> Just t `isAbout` time
  Freezes n -> time >= t && time <= t + lostAfter + seconds n + 0.001
  Charge _ -> False

isAbout :: Maybe Seconds -> Seconds -> Bool
isAbout one other = maybe False (\t -> abs (t - other) < 0.001) one

isBefore :: Seconds -> Seconds -> Bool
isBefore one other = one + 0.001 < other
