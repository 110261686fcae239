{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The functions of the schema that are about tasks.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Model.Tasks
  ( find
  , submit
  , renew
  , complete
  , startEnded
  , running
  , became
  , look
  , cancel
  , retryDead
  , listDead
  , sweep
  , wake
  ) where

import Control.Monad (forM_, mfilter, void, when)
import Control.Monad.Trans.Except (throwE)
import Data.Aeson (Value)
import qualified Data.ByteString as Bytes
import Data.Foldable (toList)
import Data.List (sortOn)
import qualified Data.Map.Strict as Map
import Data.Maybe (listToMaybe, mapMaybe)
import Data.Ord (Down (..))
import qualified Data.Set as Set
import Data.Text (Text)
import qualified Data.Text as Text
import Data.Text.Encoding (encodeUtf8)

import Behavior (Seconds)
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Model.Tables

-- | The task that has this key; of periodic ones, the one that is to come or runs, or has this full key, or was
-- cancelled.
find :: Text -> Text -> Text -> Doing (Maybe (TaskNumber, Row))
find name its full = getting (listToMaybe . sortOn order . filter (matches . snd) . Map.toList . rows)
 where
  order (n, row) = (not (isOpen row), key row /= full, Down n)
  matches row = toQueue (submitted row) == name && if isPeriodic row then ofSeries row else key row == its
  ofSeries row = withKey (submitted row) == its && (key row == full || isOpen row || taskState (task row) == Cancelled)

-- | A task: the same key again is the same task.
submit :: Seconds -> Submission -> Doing TaskNumber
submit at it = do
  when (size (toQueue it) > 200 || size (toQueue it) < 1) $ refuse "the name of a queue has 1 to 200 characters"
  when (size (withKey it) > 200 || size (withKey it) < 1) $ refuse "a key has 1 to 200 characters"
  when (maybe False (\p -> p < 1 || p > tenYears) (withPeriod it)) $ refuse "a period has 1 second to 10 years"
  when (any (\p -> p < 0 || p > tenYears) (withPauses it)) $ refuse "a pause has 0 seconds to 10 years"
  when (keptFor it < 0 || keptFor it > 10 * tenYears) $ refuse "a task is kept for 0 seconds to 100 years"
  when (Set.size (withNeeds it) > 20 || any ((\n -> n < 1 || n > 50) . size) (withNeeds it) || bytes > 1500) $
    refuse "there are at most 20 needs, each of 1 to 50 characters, of 1500 bytes together"
  find (toQueue it) (withKey it) full >>= \case
    Just (n, row)
      | taskInput (submitted row) == taskInput it && withPeriod (submitted row) == withPeriod it -> pure n
      | otherwise ->
          refuse $
            "the key '" <> withKey it <> "' of the queue '" <> toQueue it
              <> "' is that of a task with another input or period"
    Nothing -> do
      n@(TaskNumber i) <- getting nextRow
      change (\m -> m {nextRow = TaskNumber (i + 1)})
      put n new
      n <$ tell (if isLater then OfLater else OfQueue (toQueue it))
 where
  size = Text.length
  bytes = sum (map (Bytes.length . encodeUtf8) (Set.toList (withNeeds it)))
  tenYears = 315576000
  starting = maybe at (at +) (notBefore it)
  isLater = starting > at
  full = maybe (withKey it) (const (keyAt it starting)) (withPeriod it)
  new =
    Row
      { key = full
      , submitted = it
      , due = starting
      , deadline = (at +) <$> notAfter it
      , task = Task (if isLater then Later else Waiting) 0 Nothing Nothing []
      , lease = Nothing
      , robot = Text.empty
      , term = 0
      , request = Nothing
      , wakes = if isLater then Just starting else (at +) <$> notAfter it
      , isCancelled = False
      , isWatched = False
      }

-- | The key of one task of a series.
keyAt :: Submission -> Seconds -> Text
keyAt it at = withKey it <> Text.pack ('@' : show at)

-- | Keeps the lease, if it has not expired.
renew :: Seconds -> TaskNumber -> Number -> Doing [(TaskNumber, Number, Bool)]
renew at n l =
  startOf n l >>= \case
    Just row | Just end <- wakes row, end > at -> do
      put n row {wakes = Just (at + term row)}
      pure [(n, l, isCancelled row)]
    _ -> pure []

-- | Completes the task, if this is its start.
complete :: Seconds -> TaskNumber -> Number -> Value -> Doing [(TaskNumber, Number)]
complete at n l gave = startOf n l >>= maybe (pure []) (\row -> [(n, l)] <$ close at n row Done (Just gave) Nothing)

-- | The task, if that lease is the one of its start that runs.
startOf :: TaskNumber -> Number -> Doing (Maybe Row)
startOf n l = getting (mfilter (\row -> lease row == Just l && taskState (task row) == Running) . Map.lookup n . rows)

-- | The same, or it refuses.
running :: TaskNumber -> Number -> Doing Row
running n l = requireEpoch >> startOf n l >>= maybe (throwE LeaseGone) pure

-- | What became of this start.
became :: TaskNumber -> Number -> Doing Became
became n l = getting (maybe IsLost (inState . taskState . task) . mfilter ((== Just l) . lease) . Map.lookup n . rows)
 where
  inState = \case Running -> StillRuns; Done -> IsCompleted; _ -> IsLost

-- | A start has ended without a completion; whether it counts.
startEnded :: Seconds -> TaskNumber -> Row -> Text -> Bool -> Doing ()
startEnded at n row why counts
  | isCancelled row = close at n row Cancelled Nothing (Just why)
  | soFar > length (withPauses (submitted row)) = close at n row Dead Nothing (Just why)
  | otherwise = do
      put n row {task = ended, wakes = if isLater then Just again else deadline row}
      tell (if isLater then OfLater else OfQueue (toQueue (submitted row)))
      tellTask n row
 where
  soFar = taskStarts (task row) - (if counts then 0 else 1)
  again = if counts then at + (withPauses (submitted row) !! (soFar - 1)) else at
  isLater = again > at
  ended =
    (task row)
      { taskState = if isLater then Later else Waiting
      , taskStarts = soFar
      , taskReasons = taskReasons (task row) ++ [Text.unpack (Text.take 1000 why) | counts]
      }

-- | A task has ended. One that is periodic is followed by the next one.
close :: Seconds -> TaskNumber -> Row -> TaskState -> Maybe Value -> Maybe Text -> Doing ()
close at n row how gave why = do
  put n row
    { task = before {taskState = how, taskResult = gave, taskReasons = reasons}
    , wakes = if how == Dead then Nothing else Just (at + keptFor (submitted row))
    }
  tellTask n row
  forM_ (withPeriod (submitted row)) $ \period -> when (how /= Cancelled && not (isCancelled row)) $ do
    known <- getting (Map.elems . rows)
    let times = max 1 (ceiling ((at - due row) / period) :: Int)
        isTaken time = or [isOfQueue other && key other == keyAt (submitted row) time | other <- known]
        next = until (not . isTaken) (+ period) (due row + fromIntegral times * period)
        after = (\end -> next + (end - due row) - at) <$> deadline row
    void (submit at (submitted row) {notBefore = Just (next - at), notAfter = after})
 where
  before = task row
  reasons = taskReasons before ++ map Text.unpack (toList why)
  isOfQueue other = toQueue (submitted other) == toQueue (submitted row)

-- | The clock has made this task due.
wake :: Seconds -> TaskNumber -> Row -> Doing ()
wake at n row = case taskState (task row) of
  Running -> startEnded at n row "its lease has expired" True
  _ | maybe False (<= at) (deadline row) -> close at n row Dead Nothing (Just "its deadline has passed")
    | otherwise -> do
        put n row {task = (task row) {taskState = Waiting}, wakes = deadline row}
        tell (OfQueue (toQueue (submitted row)))

-- | Does what the clock has made due; when the next is.
sweep :: Seconds -> Doing (Maybe Seconds)
sweep at = do
  over <- getting (sortOn (wakes . snd) . filter (isOver . snd) . Map.toList . rows)
  forM_ (filter (isOpen . snd) over) (uncurry (wake at))
  change (\m -> m {rows = Map.filter (\row -> isOpen row || not (isOver row)) (rows m)})
  next <- getting (mapMaybe wakes . filter isOpen . Map.elems . rows)
  pure (if null next then Nothing else Just (max 0 (minimum next - at)))
 where
  isOver = maybe False (<= at) . wakes

-- | These tasks, of whose changes there are notices from now on.
look :: [TaskNumber] -> Doing [(TaskNumber, Task)]
look numbers = do
  these <- getting ((`Map.restrictKeys` Set.fromList numbers) . rows)
  forM_ (Map.toList (Map.filter (not . isWatched) these)) $ \(n, row) -> do
    put n row {isWatched = True}
    when (taskState (task row) == Waiting) $ tell (OfQueue (toQueue (submitted row)))
  pure (Map.toList (task <$> these))

-- | Cancels a task: the state that it has then.
cancel :: Seconds -> Text -> Text -> Doing (Maybe TaskState)
cancel at name its =
  find name its its >>= \case
    Nothing -> pure Nothing
    Just (n, row)
      | taskState (task row) `elem` [Later, Waiting] -> Just Cancelled <$ close at n row Cancelled Nothing Nothing
      | taskState (task row) == Running -> Just Running <$ (put n row {isCancelled = True} >> tell (OfCancel n))
      | otherwise -> pure (Just (taskState (task row)))

-- | It is not periodic any more: the next one has been submitted already.
retryDead :: Text -> Text -> Doing Bool
retryDead name its = do
  these <- getting (filter (isIt . snd) . Map.toList . rows)
  forM_ these $ \(n, row) -> do
    put n row
      { task = (task row) {taskState = Waiting, taskStarts = 0}
      , wakes = Nothing
      , deadline = Nothing
      , submitted = (submitted row) {withPeriod = Nothing}
      }
    tell (OfQueue name)
  pure (not (null these))
 where
  isIt row = toQueue (submitted row) == name && key row == its && taskState (task row) == Dead

-- | Those of a queue that are dead.
listDead :: Text -> Doing [(Text, Task)]
listDead name = getting (\m -> [(key row, known row) | row <- Map.elems (rows m), isIts row])
 where
  isIts row = toQueue (submitted row) == name && taskState (task row) == Dead
  known row = (task row) {taskProgress = Nothing, taskResult = Nothing}
