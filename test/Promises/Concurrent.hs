{-# LANGUAGE LambdaCase #-}

-- |
-- Promises about concurrent and nested behaviours.
module Promises.Concurrent
  ( -- * Stop requests in nested operators
    levels
  , stoppedAtItsOwnLevel

    -- * Simultaneous stop requests
  , groups
  , stoppedTogether

    -- * Ties
  , relays
  , leftWins
  ) where

import Control.Concurrent (myThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (unless, void, when)
import Data.Foldable (traverse_)
import Data.Maybe (fromMaybe, listToMaybe)
import Test.QuickCheck (Gen, choose, elements, frequency, vectorOf)

import Behavior (Behavior, attempt, both, failingOn, fallback, parallel)
import Behavior.Internal.Core.Failure (isCancellation)
import qualified Behavior.Parallel as Parallel
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Time (timeout)
import Places
import Promises.Stage
import Support (Cancel (..), Ending (..), hang)

-- * Stop requests in nested operators

-- | Nested operators, the outermost first. One of them stops its branch; if none does, the
-- caller is cancelled.
newtype Levels = Levels [Level]
  deriving (Show)

data Level
  = -- | Only runs the next level.
    Around OperatorPlace
  | -- | Stops the next level after the given number of ticks, or when another branch ends.
    ByTimeout Int
  | ByNeighbour
  deriving (Show)

levels :: Size -> Gen Levels
levels size = do
  stops <- elements [ByNeighbour, ByTimeout 0, ByTimeout 1, ByTimeout 2]
  case size of
    Tiny -> Levels <$> elements [[Around holding, Around trying], [stops]]
    Full -> do
      before <- choose (0, 2) >>= \n -> vectorOf n around
      after <- choose (0, 2) >>= \n -> vectorOf n around
      stopping <- frequency [(3, pure [stops]), (1, pure [])]
      pure (Levels (before ++ stopping ++ after))
 where
  around = Around <$> elements (trying : takingAll : places)
  holding = OperatorPlace "whileHolding" Nothing (Signal.whileHolding (pure True))
  trying = OperatorPlace "attempt 3" Nothing (attempt 3)
  takingAll = OperatorPlace "failingOn any" Nothing (failingOn (const True :: SomeException -> Bool))

-- | The operator that stops its branch continues after the stop. The operators inside do not
-- continue, not even with a fallback; those around it are not affected.
stoppedAtItsOwnLevel :: Stage -> Levels -> IO ()
stoppedAtItsOwnLevel stage (Levels these) = do
  inside <- newTVarIO False
  continued <- newLog
  let bottom = (atomically (writeTVar inside True) >> hang) `catch` \e -> pause stage 1 >> throwIO (e :: SomeException)
      stops = any isStop these
      build _ [] = bottom
      build n (level : further) =
        let act = build (n + 1) further
         in (level `doing` (act `fallingBack` n)) >> when (isStop level) (append continued n)
      fallingBack act n = fallback act (append continued (100 + n :: Int))
      doing level act = case level of
        Around place -> placed place act
        ByNeighbour -> parallel act (atomically (readTVar inside >>= check))
        ByTimeout n -> fallback (timeout (fromIntegral n * tick stage) act) (pure ())
      whole
        | stops = calling stage pure [] (build 0 these)
        | otherwise =
            calling
              stage
              (\() -> atomically (readTVar inside >>= check))
              [(0, Changes ()), (0, CancelsCaller)]
              (build 0 these)
  end <- run stage whole
  done <- readLog continued
  let level = length (takeWhile (not . isStop) these)
  case end of
    Gave (Gave ()) | stops, done == [level] -> pure ()
    Gave (CancelledBy _) | not stops, null done -> pure ()
    _ -> broken ("it ended: " ++ show end ++ ", and these levels continued: " ++ show done)

isStop :: Level -> Bool
isStop = \case
  Around _ -> False
  _ -> True

-- * Simultaneous stop requests

-- | Concurrent behaviours that are stopped at the same time.
data Group = Group Composition [StopHandling] StopCause
  deriving (Show)

data Composition = AsFirst | AsDecision | AsAll | AsPair | AsRace | AsForks | AsTaskAndSensor
  deriving (Eq, Show)

-- | How one of them handles its stop request.
data StopHandling
  = -- | It receives the request at once; its cleanup waits until the others have received
    -- theirs.
    SlowCleanup
  | -- | It is masked uninterruptibly until the others have received their requests.
    Uninterruptible
  deriving (Eq, Show)

data StopCause = ByCaller | ByFailure
  deriving (Eq, Show)

groups :: Size -> Gen Group
groups size = do
  composition <-
    elements ([AsFirst, AsDecision, AsAll, AsPair, AsRace] ++ [w | size == Full, w <- [AsForks, AsTaskAndSensor]])
  n <-
    if size == Full && composition `elem` [AsFirst, AsDecision, AsAll, AsForks]
      then choose (2, 3)
      else pure (2 :: Int)
  -- Two uninterruptible ones would wait for each other.
  uninterruptibleOne <- choose (0, 2 * n)
  cause <- if composition == AsTaskAndSensor || size == Tiny then pure ByCaller else elements [ByCaller, ByFailure]
  pure (Group composition [if k == uninterruptibleOne then Uninterruptible else SlowCleanup | k <- [1 .. n]] cause)

-- | Each branch that receives its stop request waits, uninterruptibly, until all have. If the
-- operator stopped one after the other, this would never end.
stoppedTogether :: Stage -> Group -> IO ()
stoppedTogether stage (Group composition handlings cause) = do
  inside <- newTVarIO (0 :: Int)
  received <- newTVarIO (0 :: Int)
  let n = length handlings
      untilReceived k = atomically (readTVar received >>= check . (>= k))
      member = \case
        SlowCleanup ->
          (atomically (modifyTVar' inside (+ 1)) >> hang) `catch` \e -> do
            when (isCancellation e) . uninterruptibleMask_ $ atomically (modifyTVar' received (+ 1)) >> untilReceived n
            throwIO e
        Uninterruptible -> uninterruptibleMask_ $ do
          atomically (modifyTVar' inside (+ 1))
          untilReceived (n - 1)
          atomically (modifyTVar' received (+ 1))
      allInside = atomically (readTVar inside >>= check . (== n))
      others = map member handlings
      culprit = [allInside >> void (finish 0 Fails) | cause == ByFailure]
      together = case (composition, others ++ culprit) of
        (AsForks, a : these) -> Parallel.scoped (\nursery -> traverse_ (Parallel.fork nursery) these >> a)
        (AsTaskAndSensor, [a, b]) -> do
          readings <- newTVarIO (0 :: Int)
          -- The task starts by the first reading; the second reading is the other member.
          let reading = do
                k <- atomically (modifyTVar' readings (+ 1) >> readTVar readings)
                False <$ when (k > 1) b
          Signal.monitor (Signal.polling (tick stage) reading) hang a
        (_, these) -> void (composed composition (map (0 <$) these))
      stimuli = case cause of
        ByCaller -> [(0, Changes ()), (0, CancelsCaller)]
        ByFailure -> [(0, Changes ())]
  end <- run stage (calling stage (const allInside) stimuli together)
  case (cause, end) of
    (ByCaller, Gave (CancelledBy _)) -> pure ()
    (ByFailure, Gave (FailedWith _)) -> pure ()
    _ -> broken ("it ended: " ++ show end)

-- | Runs them at once. Gives the sum of their results, that of the first, or zero.
composed :: Composition -> [Behavior Int] -> Behavior Int
composed composition these = case (composition, these) of
  (AsAll, _) -> sum <$> Parallel.allOf these
  -- What has ended first; on a tie the leftmost.
  (AsDecision, _) -> Parallel.decide (\outcomes -> listToMaybe [either throwIO pure end | Just end <- outcomes]) these
  (AsPair, [a, b]) -> 0 <$ both a b
  (AsRace, [a, b]) -> 0 <$ parallel a b
  _ -> Parallel.firstOf these

-- * Ties

-- | Concurrent behaviours. Those in the list end one after the other, in this order (and from
-- left to right), each when the end of the one before is published; the others do not end.
data Relay = Relay Composition Int [(Int, End)]
  deriving (Show)

relays :: Size -> Gen Relay
relays size = do
  composition <- elements [AsFirst, AsDecision, AsAll, AsPair, AsRace]
  n <- if size == Full && composition `elem` [AsFirst, AsDecision, AsAll] then choose (2, 3) else pure (2 :: Int)
  first <- choose (0, n - 1)
  runners <- traverse (\k -> (,) k <$> elements [Succeeds, Fails]) [first .. n - 1]
  let toEnd = composition `elem` [AsAll, AsPair] && first > 0 && all ((== Succeeds) . snd) runners
  -- At least one branch must end the operator.
  pure (Relay composition n (if toEnd then [(first, Fails)] else runners))

-- | The operator may run late, when several branches have ended. The branch that ended first
-- decides (or failed first, if the operator waits for all), which is also the leftmost here.
leftWins :: Stage -> Relay -> IO ()
leftWins stage (Relay composition n runners) = do
  threadIds <- traverse (const newEmptyTMVarIO) runners
  let before = pure () : map (\variable -> atomically (takeTMVar variable) >>= untilOver stage) threadIds
      runner (k, how) wait variable =
        (k, wait >> mask_ (myThreadId >>= atomically . putTMVar variable >> finish k how))
      runs = zipWith3 runner runners before threadIds
      these = [fromMaybe hang (lookup k runs) | k <- [0 .. n - 1]]
      failures = filter ((== Fails) . snd) runners
      expected = case composition of
        _ | composition `elem` [AsAll, AsPair] -> case failures of
          (k, _) : _ -> FailedWith (failureOf k)
          [] -> gave (sum (map fst runners))
        _ -> case runners of
          (k, Fails) : _ -> FailedWith (failureOf k)
          _ -> gave (maybe 0 fst (listToMaybe runners))
  end <- run stage (composed composition these)
  unless (end `elem` expected : overtaken) $
    broken ("it ended: " ++ show end ++ ", and not: " ++ show expected)
 where
  failureOf k = "Failure " ++ show (show k)
  gave result = Gave (if composition `elem` [AsPair, AsRace] then 0 else result)
  -- In a simulation, waiting for the end of a thread throws an exception to it ('untilOver').
  -- A branch that succeeds can still receive that before its end.
  overtaken = [CancelledBy (show (Cancel "untilOver")) | any ((== Succeeds) . snd) runners]
