{-# LANGUAGE LambdaCase #-}

-- |
-- Promises about reactive operators.
module Promises.Reactive
  ( -- * Dead sensors
    sensorFailures
  , notTakenForFalse

    -- * Nothing spins
  , scripts
  , aPeriodApart

    -- * Latched recoveries
  , missions
  , latched

    -- * Rereading
  , toggles
  , readAgain
  ) where

import Control.Concurrent.STM hiding (atomically, check)
import qualified Control.Concurrent.STM as STM
import Control.Exception
import Control.Monad (unless, void, when)
import Data.Foldable (for_)
import Test.QuickCheck (Gen, choose, elements, frequency, vectorOf)

import Behavior (Behavior, failWith)
import Behavior.STM (atomically)
import Behavior.Signal (watching)
import qualified Behavior.Signal as Signal
import Behavior.Time (now)
import Promises.Stage
import Support (Ending (..), Fault (..), hang)
import Watched (Operator (..), operators)
import qualified Watched

-- | Waits until the variable has a wanted value.
untilIs :: TVar a -> (a -> Bool) -> Behavior ()
untilIs var wanted = atomically (readTVar var >>= STM.check . wanted)

-- * Dead sensors

-- | A sensor that dies while the operator runs, or before its first value.
data SensorFailure = SensorFailure Operator Sensor SensorError Bool Act
  deriving (Show)

data Sensor = WatchedSensor | PolledSensor Int
  deriving (Eq, Show)

data SensorError = ReadingFails | ReadingFaults | ValueIsLost
  deriving (Eq, Show)

sensorFailures :: Size -> Gen SensorFailure
sensorFailures size = do
  sensor <-
    if size == Tiny
      then pure WatchedSensor
      else frequency [(1, pure WatchedSensor), (2, PolledSensor <$> choose (1, 2))]
  fromTheStart <- frequency [(4, pure False), (1, pure True)]
  cause <- elements ([ReadingFails, ReadingFaults] ++ [ValueIsLost | sensor == WatchedSensor, not fromTheStart])
  op <- elements operators
  act <- acts 7
  pure (SensorFailure op sensor cause fromTheStart act)

-- | The branch is stopped, no other branch starts, and the operator throws what the sensor
-- threw, unless the branch ends otherwise than by stopping.
notTakenForFalse :: Stage -> SensorFailure -> IO ()
notTakenForFalse stage (SensorFailure op sensor cause fromTheStart act) = do
  dead <- newTVarIO fromTheStart
  inside <- newTVarIO False
  others <- newLog
  let reading :: STM Bool
      reading =
        readTVar dead >>= \case
          False -> pure True
          True -> case cause of
            ReadingFails -> failWith "the sensor"
            ReadingFaults -> throwSTM (Fault "the sensor")
            ValueIsLost -> retry
      signal = case sensor of
        WatchedSensor -> watching reading
        PolledSensor n -> Signal.polling (fromIntegral n * tick stage) (atomically reading)
      branch =
        perform stage (atomically (writeTVar inside True)) (pure ()) act
          {takes = untilStopped, uninterruptible = False}
      operating = running op signal (show <$> branch) ("" <$ append others ())
      stimuli = [(0, Changes ()) | not fromTheStart]
  end <- run stage (calling stage (\() -> untilIs inside id >> atomically (writeTVar dead True)) stimuli operating)
  started <- readLog others
  unless (null started) $ broken "the other branch started"
  let expected
        | fromTheStart = sensors
        | otherwise = case stopResponse act of
            Stops -> sensors
            Completes -> Gave (show (negate (number act)))
            FailsToStop -> FailedWith ("Failure " ++ show (show (number act)))
            FaultsInCleanup -> FaultedWith (show (Fault ("the cleanup of " ++ show (number act))))
      sensors = case cause of
        ReadingFails -> FailedWith "FailedBecause \"the sensor\""
        ReadingFaults -> FaultedWith (show (Fault "the sensor"))
        ValueIsLost -> FailedWith "FailedBecause \"the signal has no value any more\""
      -- The sensor may also have faulted once more while it was stopped: then that is thrown.
      again = [sensors | cause == ReadingFaults, sensor /= WatchedSensor]
  unless (end `elem` map Gave (expected : again)) $
    broken ("it ended: " ++ show end ++ ", and not: " ++ show expected)

-- * Nothing spins

-- | The values of a polled condition's readings; after these, all are false, and the branches
-- end.
data Script = Script Operator Int [Bool]
  deriving (Show)

scripts :: Size -> Gen Script
scripts size =
  Script
    <$> elements operators
    <*> choose (1, 3)
    <*> (choose (0, if size == Tiny then 2 else 6) >>= \n -> vectorOf n (elements [False, True]))

-- | Readings start at least a period apart, rereads and those after a recovery included.
aPeriodApart :: Stage -> Script -> IO ()
aPeriodApart stage (Script op every values) = do
  started <- newTVarIO (0 :: Int)
  begun <- newLog
  let apart = fromIntegral every * tick stage
      reading = do
        now >>= append begun
        k <- atomically (modifyTVar' started (+ 1) >> readTVar started)
        pure (or (take 1 (drop (k - 1) values)))
      branch = "" <$ untilIs started (> length values + 1)
      signal = Signal.polling apart reading
  end <- run stage $ do
    t <- now
    -- (What is latched ends at once: no reading would end it.)
    let other = if Watched.latched op then pure "" else branch
    (,) t <$> calling stage pure [] (running op (not <$> signal) branch other)
  case end of
    Gave (t, ended) -> do
      moments <- readLog begun
      for_ (zip [0 :: Int ..] moments) $ \(k, moment) ->
        -- A period is a sum of fractions, each rounded.
        when (moment - t < fromIntegral k * apart - 1e-9) $
          broken
            ( "reading " ++ show (k + 1) ++ " began " ++ show (moment - t)
                ++ " after the start, and the period is " ++ show apart
            )
      case ended of
        Gave _ -> pure ()
        FailedWith _ | operator op == "whileHolding", or values -> pure ()
        _ -> broken ("it ended: " ++ show ended)
    _ -> broken ("it ended: " ++ show end)

-- * Latched recoveries

-- | A task that needs one or more recoveries. The first may be needed at the start, or only
-- while the task runs; then perhaps it is not needed any more when the task has ended. While
-- a recovery runs, the need may change repeatedly.
data Mission = Mission
  { atTheStart :: Bool
  , withdrawn :: Bool
  , task :: Act
  , rounds :: [(Int, [Bool])]
  -- ^ For each recovery the values that it gives to the condition, and the ticks before each.
  -- The last is true if another recovery is to follow.
  , ofRecovery :: End
  -- ^ How the last recovery ends.
  }
  deriving (Show)

missions :: Size -> Gen Mission
missions size = do
  n <- choose (1, if size == Tiny then 1 else 3 :: Int)
  let values k = choose (0, 2) >>= \m -> (++ [k < n]) <$> vectorOf m (elements [False, True])
      aRound k = (,) <$> choose (0, 2) <*> values k
  Mission
    <$> elements [False, True]
    <*> elements [False, True]
    <*> acts 5
    <*> traverse aRound [1 .. n]
    <*> frequency [(4, pure Succeeds), (1, ends)]

data Milestone = TaskStarts | TaskStopRequested | RecoveryStarts | RecoveryEnds | RecoveryStopRequested
  deriving (Eq, Show)

-- | After the stop request for the task, the recovery runs, to its end; and again as long as
-- the condition holds when it is read again. If the task completes despite the request, the
-- recovery does not run. If the task fails or faults, the recovery runs, and then the failure
-- or fault is thrown.
latched :: Stage -> Mission -> IO ()
latched stage mission = do
  needed <- newTVarIO (atTheStart mission)
  inside <- newTVarIO False
  runs <- newTVarIO (0 :: Int)
  roundsLeft <- newTVarIO (rounds mission)
  milestones <- newLog
  let neededAtStart = atTheStart mission
      working = do
        append milestones TaskStarts
        k <- atomically (modifyTVar' runs (+ 1) >> readTVar runs)
        if neededAtStart || k > 1 then pause stage 1 >> pure 0 else untilStopRequested
      -- It certainly receives a stop request: the condition becomes true, and it has no end.
      untilStopRequested =
        (atomically (writeTVar inside True) >> hang) `catch` \e -> do
          append milestones TaskStopRequested
          when (withdrawn mission) . atomically $ writeTVar needed False
          pause stage (cleanup (task mission))
          case stopResponse (task mission) of
            Stops -> throwIO (e :: SomeException)
            Completes -> pure 5
            FailsToStop -> finish 5 Fails
            FaultsInCleanup -> finish 5 Faults
      recovering = do
        append milestones RecoveryStarts
        (takesLong, changes, isLast) <- atomically $
          readTVar roundsLeft >>= \case
            [] -> pure (0, [False], True)
            (k, bs) : more -> (k, bs, null more) <$ writeTVar roundsLeft more
        for_ changes (\b -> pause stage takesLong >> atomically (writeTVar needed b))
          `onException` append milestones RecoveryStopRequested
        append milestones RecoveryEnds
        when isLast . void $ finish 9 (ofRecovery mission)
      stimuli = [(0, Changes ()) | not neededAtStart]
      whole = Signal.monitor (watching (readTVar needed)) recovering working
  end <- run stage (calling stage (\() -> untilIs inside id >> atomically (writeTVar needed True)) stimuli whole)
  reached <- readLog milestones
  let recovery = [RecoveryStarts, RecoveryEnds]
      allRecoveries = concatMap (const recovery) (rounds mission)
      wrongTask = stopResponse (task mission) `elem` [FailsToStop, FaultsInCleanup]
      afterwards
        | ofRecovery mission == Succeeds = ([TaskStarts], Gave 0)
        | otherwise = ([], thrown 9 (ofRecovery mission))
      onceWrong = case rounds mission of
        [_] | ofRecovery mission == Faults, stopResponse (task mission) == FailsToStop -> thrown 9 Faults
        _ -> thrown 5 (if stopResponse (task mission) == FailsToStop then Fails else Faults)
      inTheEnd before = let (after, how) = afterwards in (before ++ allRecoveries ++ after, how)
      expected
        | neededAtStart = inTheEnd []
        | stopResponse (task mission) == Completes = ([TaskStarts, TaskStopRequested], Gave 5)
        | wrongTask = ([TaskStarts, TaskStopRequested] ++ recovery, onceWrong)
        | otherwise = inTheEnd [TaskStarts, TaskStopRequested]
  unless ((reached, end) == (Gave <$> expected)) $
    broken ("these steps: " ++ show reached ++ ", and the end " ++ show end ++ "; and not: " ++ show expected)
 where
  thrown :: Int -> End -> Ending Int
  thrown n = \case
    Fails -> FailedWith ("Failure " ++ show (show n))
    _ -> FaultedWith ("Fault " ++ show (show n))

-- * Rereading

-- | A condition that changes while each branch runs, and once more while that branch stops.
data Toggles = Toggles Sensor Bool [(Int, Bool)]
  deriving (Show)

toggles :: Size -> Gen Toggles
toggles size =
  Toggles
    <$> (if size == Tiny then pure WatchedSensor else elements [WatchedSensor, PolledSensor 1, PolledSensor 2])
    <*> elements [False, True]
    <*> (choose (1, if size == Tiny then 1 else 3) >>= \n -> vectorOf n change)
 where
  change = (,) <$> choose (0, 2) <*> elements [False, True]

-- | The next branch is chosen by the condition's value at the end of the branch before.
readAgain :: Stage -> Toggles -> IO ()
readAgain stage (Toggles sensor first stops) = do
  condition <- newTVarIO first
  starts <- newTVarIO (0 :: Int)
  left <- newTVarIO stops
  started <- newLog
  let signal = case sensor of
        WatchedSensor -> watching (readTVar condition)
        PolledSensor n -> Signal.polling (fromIntegral n * tick stage) (atomically (readTVar condition))
      branch name = do
        append started name
        again <- atomically (readTVar left)
        case again of
          [] -> pause stage 1
          (takesLong, new) : more ->
            (atomically (modifyTVar' starts (+ 1)) >> hang) `catch` \e -> do
              atomically (writeTVar left more)
              pause stage takesLong
              atomically (writeTVar condition new)
              throwIO (e :: SomeException)
      toggle k = untilIs starts (>= k) >> atomically (modifyTVar' condition not)
      whole = Signal.rSelect signal (branch True) (branch False)
  end <- run stage (calling stage toggle [(0, Changes k) | k <- [1 .. length stops]] whole)
  these <- readLog started
  let expected = first : map snd stops
  unless (end == Gave (Gave ()) && these == expected) $
    broken ("it ended: " ++ show end ++ ", and these started: " ++ show these ++ "; and not: " ++ show expected)
