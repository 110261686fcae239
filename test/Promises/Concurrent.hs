{-# LANGUAGE LambdaCase #-}

-- |
-- Promises of behaviours that run side by side, and inside of one another.
module Promises.Concurrent
  ( -- * Stopped at its own level
    levels
  , stoppedAtItsLevel

    -- * Together
  , companies
  , askedTogether

    -- * The first, and left of those that tie
  , relays
  , leftWins
  ) where

import Control.Concurrent (myThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (unless, void, when)
import Data.Maybe (fromMaybe, listToMaybe)
import Test.QuickCheck (Gen, choose, elements, frequency, vectorOf)

import Behavior.Internal.Failure (isCancellation)
import Behavior.Internal.Runtime (atomically)
import Promises.Language (Language)
import qualified Promises.Language as L
import Promises.Stage
import Support (Cancel (..), Ending (..), hang)

-- * Stopped at its own level

-- | Operators around one another, the outermost first. One of them stops what is in it;
-- if none does, the caller is cancelled.
newtype Levels = Levels [Level]
  deriving (Show)

data Level
  = -- | Does nothing but to run what is in it.
    Around Place
  | -- | Stops what is in it, after so many ticks or by a neighbour.
    ByTimeout Int
  | ByNeighbour
  deriving (Eq, Show)

data Place = InParallel | InBoth | InFirst | InAll | InSelect | InTask | InHolding | InTimeout | InAttempt | InFailing | InScope
  deriving (Bounded, Enum, Eq, Show)

levels :: Size -> Gen Levels
levels size = do
  stops <- elements [ByNeighbour, ByTimeout 0, ByTimeout 1, ByTimeout 2]
  case size of
    Tiny -> Levels <$> elements [[Around InHolding, Around InAttempt], [stops]]
    Full -> do
      before <- choose (0, 2) >>= \n -> vectorOf n around
      after <- choose (0, 2) >>= \n -> vectorOf n around
      stopping <- frequency [(3, pure [stops]), (1, pure [])]
      pure (Levels (before ++ stopping ++ after))
 where
  around = Around <$> elements [minBound .. maxBound]

-- | The operator that stops gets past its stop, those in it do not, whatever they have
-- to fall back on; and those around it know nothing of it.
stoppedAtItsLevel :: Stage -> Language -> Levels -> IO ()
stoppedAtItsLevel stage l (Levels these) = do
  inside <- newTVarIO False
  wentOn <- newJournal
  let bottom = (atomically (writeTVar inside True) >> hang) `catch` \e -> pause stage 1 >> throwIO (e :: SomeException)
      stops = any isStop these
      build _ [] = bottom
      build n (level : further) =
        let act = build (n + 1) further
         in (level `doing` (act `fallingBack` n)) >> when (isStop level) (enter wentOn n)
      fallingBack act n = L.fallback l act (enter wentOn (100 + n :: Int))
      doing level act = case level of
        Around InParallel -> L.parallel l act hang
        Around InBoth -> L.both l (pure ()) act
        Around InFirst -> L.firstOf l [act, hang]
        Around InAll -> void (L.allOf l [act, pure ()])
        Around InSelect -> L.rSelect l (pure False) hang act
        Around InTask -> L.monitor l (pure False) hang act
        Around InHolding -> L.whileHolding l (pure True) act
        Around InTimeout -> L.timeout l (fromIntegral untilStopped * tick stage) act
        Around InAttempt -> L.attempt l 3 act
        Around InFailing -> L.failing l act
        Around InScope -> L.beside l [hang] act
        ByNeighbour -> L.parallel l act (atomically (readTVar inside >>= check))
        ByTimeout n -> L.fallback l (L.timeout l (fromIntegral n * tick stage) act) (pure ())
      whole
        | stops = calling stage pure [] (build 0 these)
        | otherwise = calling stage (\() -> atomically (readTVar inside >>= check)) [(0, Changes ()), (0, CancelsIt)] (build 0 these)
  end <- run stage whole
  done <- journal wentOn
  let level = length (takeWhile (not . isStop) these)
  case end of
    Gave (Gave ()) | stops, done == [level] -> pure ()
    Gave (CancelledBy _) | not stops, null done -> pure ()
    _ -> broken ("it ended: " ++ show end ++ ", and what went on is " ++ show done)

isStop :: Level -> Bool
isStop = \case
  Around _ -> False
  _ -> True

-- * Together

-- | Behaviours side by side that have to stop at the same time.
data Company = Company Way [Manner] Cause
  deriving (Show)

data Way = AsFirst | AsAll | AsPair | AsRace | AsForks | AsTaskAndSensor
  deriving (Eq, Show)

-- | How one of them is when it is asked to stop.
data Manner
  = -- | It hears at once; its cleanup waits for the others to hear.
    SlowCleanup
  | -- | It cannot hear before the others have.
    Deaf
  deriving (Eq, Show)

data Cause = ByCaller | ByFailure
  deriving (Eq, Show)

companies :: Size -> Gen Company
companies size = do
  way <- elements ([AsFirst, AsAll, AsPair, AsRace] ++ [w | size == Full, w <- [AsForks, AsTaskAndSensor]])
  n <- if size == Full && way `elem` [AsFirst, AsAll, AsForks] then choose (2, 3) else pure (2 :: Int)
  -- If two were deaf to the end, they would wait for each other.
  deafOne <- choose (0, 2 * n)
  cause <- if way == AsTaskAndSensor || size == Tiny then pure ByCaller else elements [ByCaller, ByFailure]
  pure (Company way [if k == deafOne then Deaf else SlowCleanup | k <- [1 .. n]] cause)

-- | Whoever is asked to stop waits, uninterruptibly, until all are. If they were asked
-- one after the other, that would never be.
askedTogether :: Stage -> Language -> Company -> IO ()
askedTogether stage l (Company way manners cause) = do
  inside <- newTVarIO (0 :: Int)
  heard <- newTVarIO (0 :: Int)
  let n = length manners
      untilHeard k = atomically (readTVar heard >>= check . (>= k))
      member = \case
        SlowCleanup ->
          (atomically (modifyTVar' inside (+ 1)) >> hang) `catch` \e -> do
            when (isCancellation e) . uninterruptibleMask_ $ atomically (modifyTVar' heard (+ 1)) >> untilHeard n
            throwIO e
        Deaf -> uninterruptibleMask_ $ do
          atomically (modifyTVar' inside (+ 1))
          untilHeard (n - 1)
          atomically (modifyTVar' heard (+ 1))
      allInside = atomically (readTVar inside >>= check . (== n))
      others = map member manners
      culprit = [allInside >> void (finish 0 Fails) | cause == ByFailure]
      together = case (way, others ++ culprit) of
        (AsAll, these) -> void (L.allOf l these)
        (AsPair, [a, b]) -> L.both l a b
        (AsRace, [a, b]) -> L.parallel l a b
        (AsForks, a : these) -> L.beside l these a
        (AsTaskAndSensor, [a, b]) -> do
          asked <- newTVarIO (0 :: Int)
          -- The task starts by the first reading, and the second one is the member.
          let reading = do
                k <- atomically (modifyTVar' asked (+ 1) >> readTVar asked)
                False <$ when (k > 1) b
          L.monitor l (L.polling l (tick stage) reading) hang a
        (_, these) -> L.firstOf l these
      deeds = case cause of
        ByCaller -> [(0, Changes ()), (0, CancelsIt)]
        ByFailure -> [(0, Changes ())]
  end <- run stage (calling stage (const allInside) deeds together)
  case (cause, end) of
    (ByCaller, Gave (CancelledBy _)) -> pure ()
    (ByFailure, Gave (FailedWith _)) -> pure ()
    _ -> broken ("it ended: " ++ show end)

-- * The first, and left of those that tie

-- | Behaviours side by side. Those in the list end one after the other, in this order
-- (and from left to right), each when the one before has ended and anybody could have
-- seen it; the rest does not end.
data Relay = Relay Way Int [(Int, End)]
  deriving (Show)

relays :: Size -> Gen Relay
relays size = do
  way <- elements [AsFirst, AsAll, AsPair, AsRace]
  n <- if size == Full && way `elem` [AsFirst, AsAll] then choose (2, 3) else pure (2 :: Int)
  first <- choose (0, n - 1)
  runners <- traverse (\k -> (,) k <$> elements [Succeeds, Fails]) [first .. n - 1]
  let toEnd = way `elem` [AsAll, AsPair] && first > 0 && all ((== Succeeds) . snd) runners
  -- Somebody must end it.
  pure (Relay way n (if toEnd then [(first, Fails)] else runners))

-- | The operator may look late, when several have ended. It goes by the one that ended
-- first (or failed first, where it waits for all), which here is the leftmost too.
leftWins :: Stage -> Language -> Relay -> IO ()
leftWins stage l (Relay way n runners) = do
  batons <- traverse (const newEmptyTMVarIO) runners
  let before = pure () : map (\baton -> atomically (takeTMVar baton) >>= untilOver stage) batons
      runner (k, how) wait baton =
        (k, wait >> mask_ (myThreadId >>= atomically . putTMVar baton >> finish k how))
      lanes = zipWith3 runner runners before batons
      these = [fromMaybe hang (lookup k lanes) | k <- [0 .. n - 1]]
      whole = case (way, these) of
        (AsAll, _) -> sum <$> L.allOf l these
        (AsPair, [a, b]) -> 1 <$ L.both l a b
        (AsRace, [a, b]) -> firstNumber <$ L.parallel l a b
        _ -> L.firstOf l these
      firstNumber = maybe 0 fst (listToMaybe runners)
      failures = filter ((== Fails) . snd) runners
      expected = case way of
        _ | way `elem` [AsAll, AsPair] -> case failures of
          (k, _) : _ -> FailedWith (failureOf k)
          [] -> Gave (sum (map fst runners))
        _ -> case runners of
          (k, Fails) : _ -> FailedWith (failureOf k)
          _ -> Gave firstNumber
  end <- run stage whole
  unless (end `elem` expected : overtaken) $
    broken ("it ended: " ++ show end ++ ", and not: " ++ show expected)
 where
  failureOf k = "Failure " ++ show (show k)
  -- What waits for the end of a runner in a simulation throws to it. One that succeeds can
  -- still receive that, if it was not quick enough.
  overtaken = [CancelledBy (show (Cancel "nobody")) | any ((== Succeeds) . snd) runners]
