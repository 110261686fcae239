{-# LANGUAGE LambdaCase #-}

-- |
-- Promises of what reacts to conditions.
module Promises.Reactive
  ( -- * Dead sensors
    deaths
  , notTakenForFalse

    -- * Nothing spins
  , scripts
  , aPeriodApart

    -- * Latched
  , missions
  , latched

    -- * Read again
  , turns
  , readAgain
  ) where

import Control.Concurrent.STM hiding (atomically, check)
import qualified Control.Concurrent.STM as STM
import Control.Exception
import Control.Monad (unless, void, when)
import Data.Foldable (for_)
import Test.QuickCheck (Gen, choose, elements, frequency, vectorOf)

import Behavior (Behavior, failWith)
import Behavior.Internal.Runtime (atomically)
import Behavior.Signal (watching)
import Behavior.Time (now)
import Promises.Language (Language)
import qualified Promises.Language as L
import Promises.Stage
import Support (Ending (..), Fault (..), hang)

-- | What waits for something: a transaction that can be waited for.
until' :: TVar a -> (a -> Bool) -> Behavior ()
until' var wanted = atomically (readTVar var >>= STM.check . wanted)

-- * Dead sensors

-- | A sensor dies while the operator runs, or before it had a first value.
data Death = Death Operator Sensor Cause Bool Act
  deriving (Show)

data Operator = Selecting Bool | Monitoring | Holding
  deriving (Eq, Show)

data Sensor = Event | Poll Int
  deriving (Eq, Show)

data Cause = Failing | Faulting | Losing
  deriving (Eq, Show)

deaths :: Size -> Gen Death
deaths size = do
  sensor <- if size == Tiny then pure Event else frequency [(1, pure Event), (2, Poll <$> choose (1, 2))]
  fromTheStart <- frequency [(4, pure False), (1, pure True)]
  cause <- elements ([Failing, Faulting] ++ [Losing | sensor == Event, not fromTheStart])
  operator <- elements [Selecting False, Selecting True, Monitoring, Holding]
  act <- acts 7
  pure (Death operator sensor cause fromTheStart act)

-- | The branch is stopped, no other starts, and the operator throws what the sensor did,
-- unless the branch has something to say itself.
notTakenForFalse :: Stage -> Language -> Death -> IO ()
notTakenForFalse stage l (Death operator sensor cause fromTheStart act) = do
  dead <- newTVarIO fromTheStart
  inside <- newTVarIO False
  others <- newJournal
  let value = operator `elem` [Selecting True, Holding]
      reading :: STM Bool
      reading =
        readTVar dead >>= \case
          False -> pure value
          True -> case cause of
            Failing -> failWith "the sensor"
            Faulting -> throwSTM (Fault "the sensor")
            Losing -> retry
      signal = case sensor of
        Event -> watching reading
        Poll n -> L.polling l (fromIntegral n * tick stage) (atomically reading)
      branch = perform stage (atomically (writeTVar inside True)) (pure ()) act {takes = untilStopped, deaf = False}
      other = 0 <$ enter others ()
      operating = case operator of
        Selecting True -> L.rSelect l signal branch other
        Selecting False -> L.rSelect l signal other branch
        Monitoring -> L.monitor l signal (enter others ()) branch
        Holding -> L.whileHolding l signal branch
      deeds = [(0, Changes ()) | not fromTheStart]
  end <- run stage (calling stage (\() -> until' inside id >> atomically (writeTVar dead True)) deeds operating)
  started <- journal others
  unless (null started) $ broken "the other branch started"
  let expected
        | fromTheStart = sensors
        | otherwise = case aftermath act of
            Stops -> sensors
            Completes -> Gave (negate (number act))
            FailsToStop -> FailedWith ("Failure " ++ show (show (number act)))
            FaultsInCleanup -> FaultedWith (show (Fault ("the cleanup of " ++ show (number act))))
      sensors = case cause of
        Failing -> FailedWith "FailedBecause \"the sensor\""
        Faulting -> FaultedWith (show (Fault "the sensor"))
        Losing -> FailedWith "FailedBecause \"the signal has no value any more\""
      -- The sensor may have faulted once more while it was stopped too: then that counts.
      again = [sensors | cause == Faulting, sensor /= Event]
  unless (end `elem` map Gave (expected : again)) $
    broken ("it ended: " ++ show end ++ ", and not: " ++ show expected)

-- * Nothing spins

-- | What a polled condition says, reading by reading; then it says false for ever, and
-- the branches end.
data Script = Script Operator Int [Bool]
  deriving (Show)

scripts :: Size -> Gen Script
scripts size =
  Script
    <$> elements [Selecting True, Monitoring, Holding]
    <*> choose (1, 3)
    <*> (choose (0, if size == Tiny then 2 else 6) >>= \n -> vectorOf n (elements [False, True]))

-- | Readings start at least a period apart, rereads and those after a recovery included.
aPeriodApart :: Stage -> Language -> Script -> IO ()
aPeriodApart stage l (Script operator every values) = do
  asked <- newTVarIO (0 :: Int)
  begun <- newJournal
  let apart = fromIntegral every * tick stage
      reading = do
        now >>= enter begun
        k <- atomically (modifyTVar' asked (+ 1) >> readTVar asked)
        pure (and (take 1 (drop (k - 1) values)) && k <= length values)
      branch = until' asked (> length values + 1)
      signal = L.polling l apart reading
  end <- run stage $ do
    t <- now
    (,) t <$> calling stage pure [] (case operator of
      Monitoring -> L.monitor l signal (pure ()) branch
      Selecting _ -> L.rSelect l signal branch branch
      Holding -> L.whileHolding l (not <$> signal) branch)
  case end of
    Gave (t, ended) -> do
      moments <- journal begun
      for_ (zip [0 :: Int ..] moments) $ \(k, moment) ->
        -- A period is a sum of fractions, each rounded.
        when (moment - t < fromIntegral k * apart - 1e-9) $
          broken ("reading " ++ show (k + 1) ++ " began " ++ show (moment - t) ++ " after the start, and the period is " ++ show apart)
      case ended of
        Gave () -> pure ()
        FailedWith _ | operator == Holding, or values -> pure ()
        _ -> broken ("it ended: " ++ show ended)
    _ -> broken ("it ended: " ++ show end)

-- * Latched

-- | A task that needs a recovery, once or more often. It may be needed at the start, or
-- comes to be while the task runs; then it is perhaps not needed any more when the task
-- has ended. And it may come to be needed and not, again and again, while it runs.
data Mission = Mission
  { atTheStart :: Bool
  , withdrawn :: Bool
  , task :: Act
  , rounds :: [(Int, [Bool])]
  -- ^ What each recovery has the condition be, by and by; the last is true if another
  -- one is to follow.
  , ofRecovery :: End
  -- ^ How the last recovery ends.
  }
  deriving (Show)

missions :: Size -> Gen Mission
missions size = do
  n <- choose (1, if size == Tiny then 1 else 3 :: Int)
  Mission
    <$> elements [False, True]
    <*> elements [False, True]
    <*> acts 5
    <*> traverse (\k -> (,) <$> choose (0, 2) <*> ((++ [k < n]) <$> (choose (0, 2) >>= \m -> vectorOf m (elements [False, True])))) [1 .. n]
    <*> frequency [(4, pure Succeeds), (1, ends)]

data Happening = TaskStarts | TaskIsAsked | RecoveryStarts | RecoveryEnds | RecoveryIsAsked
  deriving (Eq, Show)

-- | Once the task was asked to stop, the recovery runs, to its end; and again while the
-- condition holds when it is read afresh. If the task completed all the same, it does
-- not; if it failed or faulted, it does all the same, and then that is thrown.
latched :: Stage -> Language -> Mission -> IO ()
latched stage l mission = do
  needed <- newTVarIO (atTheStart mission)
  inside <- newTVarIO False
  runs <- newTVarIO (0 :: Int)
  roundsLeft <- newTVarIO (rounds mission)
  happenings <- newJournal
  let asked = atTheStart mission
      working = do
        enter happenings TaskStarts
        k <- atomically (modifyTVar' runs (+ 1) >> readTVar runs)
        if asked || k > 1 then pause stage 1 >> pure 0 else untilAsked
      -- It is asked to stop for sure: somebody sets the condition, and it has no end.
      untilAsked =
        (atomically (writeTVar inside True) >> hang) `catch` \e -> do
          enter happenings TaskIsAsked
          when (withdrawn mission) . atomically $ writeTVar needed False
          pause stage (cleanup (task mission))
          case aftermath (task mission) of
            Stops -> throwIO (e :: SomeException)
            Completes -> pure 5
            FailsToStop -> finish 5 Fails
            FaultsInCleanup -> finish 5 Faults
      recovering = do
        enter happenings RecoveryStarts
        (takesLong, changes, isLast) <- atomically $
          readTVar roundsLeft >>= \case
            [] -> pure (0, [False], True)
            (k, bs) : more -> (k, bs, null more) <$ writeTVar roundsLeft more
        for_ changes (\b -> pause stage takesLong >> atomically (writeTVar needed b))
          `onException` enter happenings RecoveryIsAsked
        enter happenings RecoveryEnds
        when isLast . void $ finish 9 (ofRecovery mission)
      deeds = [(0, Changes ()) | not asked]
      whole = L.monitor l (watching (readTVar needed)) recovering working
  end <- run stage (calling stage (\() -> until' inside id >> atomically (writeTVar needed True)) deeds whole)
  happened <- journal happenings
  let recovery = [RecoveryStarts, RecoveryEnds]
      allRecoveries = concatMap (const recovery) (rounds mission)
      wrongTask = aftermath (task mission) `elem` [FailsToStop, FaultsInCleanup]
      afterwards
        | ofRecovery mission == Succeeds = ([TaskStarts], Gave 0)
        | otherwise = ([], thrown 9 (ofRecovery mission))
      onceWrong = case rounds mission of
        [_] | ofRecovery mission == Faults, aftermath (task mission) == FailsToStop -> thrown 9 Faults
        _ -> thrown 5 (if aftermath (task mission) == FailsToStop then Fails else Faults)
      inTheEnd before = let (after, how) = afterwards in (before ++ allRecoveries ++ after, how)
      expected
        | asked = inTheEnd []
        | aftermath (task mission) == Completes = ([TaskStarts, TaskIsAsked], Gave 5)
        | wrongTask = ([TaskStarts, TaskIsAsked] ++ recovery, onceWrong)
        | otherwise = inTheEnd [TaskStarts, TaskIsAsked]
  unless ((happened, end) == (Gave <$> expected)) $
    broken ("this happened: " ++ show happened ++ ", " ++ show end ++ "; and not: " ++ show expected)
 where
  thrown :: Int -> End -> Ending Int
  thrown n = \case
    Fails -> FailedWith ("Failure " ++ show (show n))
    _ -> FaultedWith ("Fault " ++ show (show n))

-- * Read again

-- | A condition that is changed when the first branch runs, and by each branch again
-- while it is stopping.
data Turns = Turns Sensor Bool [(Int, Bool)]
  deriving (Show)

turns :: Size -> Gen Turns
turns size =
  Turns
    <$> (if size == Tiny then pure Event else elements [Event, Poll 1, Poll 2])
    <*> elements [False, True]
    <*> (choose (1, if size == Tiny then 1 else 3) >>= \n -> vectorOf n ((,) <$> choose (0, 2) <*> elements [False, True]))

-- | What starts is what the condition says when the branch before has ended.
readAgain :: Stage -> Language -> Turns -> IO ()
readAgain stage l (Turns sensor first stops) = do
  condition <- newTVarIO first
  starts <- newTVarIO (0 :: Int)
  left <- newTVarIO stops
  started <- newJournal
  let signal = case sensor of
        Event -> watching (readTVar condition)
        Poll n -> L.polling l (fromIntegral n * tick stage) (atomically (readTVar condition))
      branch name = do
        enter started name
        again <- atomically (readTVar left)
        case again of
          [] -> pause stage 1
          (takesLong, new) : more ->
            (atomically (modifyTVar' starts (+ 1)) >> hang) `catch` \e -> do
              atomically (writeTVar left more)
              pause stage takesLong
              atomically (writeTVar condition new)
              throwIO (e :: SomeException)
      turn k = until' starts (>= k) >> atomically (modifyTVar' condition not)
      whole = L.rSelect l signal (branch True) (branch False)
  end <- run stage (calling stage turn [(0, Changes k) | k <- [1 .. length stops]] whole)
  these <- journal started
  let expected = first : map snd stops
  unless (end == Gave (Gave ()) && these == expected) $
    broken ("it ended: " ++ show end ++ ", and these started: " ++ show these ++ "; and not: " ++ show expected)
