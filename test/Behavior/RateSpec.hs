{-# LANGUAGE LambdaCase #-}

-- |
-- How often a signal changes, and how old it is: 'Signal.throttle', 'Signal.changes' and
-- 'Signal.olderThan'; and the name of a signal.
module Behavior.RateSpec (spec) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (onException)
import Control.Monad (forever, unless, when)
import Data.Foldable (for_)
import Data.IORef
import Data.List (groupBy)
import Test.Hspec hiding (after, before)
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck (Gen, choose, forAll, ioProperty, listOf1, (===))

import Behavior
import Behavior.STM (atomically)
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Sim (Run (finished), explore, randomly, simulate)
import Behavior.Time (now, sleepUntil)
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "throttle" throttle
  describe "changes" changes
  describe "olderThan" olderThan
  describe "named" naming
  describe "A drone that gets a new path while it flies" replanning

throttle :: Spec
throttle = do
  prop "takes a change at once, or when the time has passed, and never loses the last" $
    forAll script $ \steps -> ioProperty $
      -- (No whole number, so that the time never ends in the moment of a change.)
      (=== throttled 3.14159 steps) <$> observed (Signal.throttle 3.14159) steps

  it "takes at once the first value after a recovery" $ do
    level <- newTVarIO (0 :: Int)
    let recovery = atomically (writeTVar level 0)
        task = sleep 1 >> atomically (writeTVar level 1) >> hang
    run <- simulate (Signal.monitor ((== 1) <$> Signal.throttle 10 (watchedVar level)) recovery task ||| sleep 30)
    -- At 10, 20 and 30 (not at 1): the first value after each recovery counts at once, the next change 10 s later.
    finished run `shouldBe` 30

  it "takes at once the first value after a recovery, and not the one before, under any schedule" $
    beginsAfreshAtARecovery (Signal.throttle 10)

  it "of zero seconds follows its signal" $ do
    condition <- newTestCondition True
    Signal.rSelect (Signal.throttle 0 (watched condition)) (set condition (Value False) >> hang) (pure "right")
      `shouldReturn` "right"

  for_ [SensorFailure, SensorFault, NoValue] $ \newState ->
    it ("does not wait when the new state of its signal is " ++ show newState) $ do
      condition <- newTestCondition True
      ending (Signal.rSelect (Signal.throttle (1 / 0) (watched condition)) (set condition newState >> hang) (pure ()))
        `shouldReturn` sensorEnds newState

  it "refuses a negative number and NaN, and nothing starts" $
    refusing "throttle" Signal.throttle

changes :: Spec
changes = do
  prop "counts the changes that can be seen" $
    forAll script $ \steps -> ioProperty ((=== counted steps) <$> observed Signal.changes steps)

  it "stays changed, where a Bool that is true for an instant is missed" $ do
    missing (\place _ -> (> 0) <$> Signal.changes place) `shouldReturn` False
    missing (\_ fresh -> fresh) `shouldReturn` True

  it "keeps its count across recoveries" $ do
    level <- newTVarIO 'a'
    seen <- newLog
    let signal = (,) <$> Signal.changes (watchedVar level) <*> watchedVar level
        branch (n, c) = note seen (n, c) >> unless (c == 'd') (atomically (writeTVar level (succ c)) >> hang)
    Signal.switch signal branch
    notes seen `shouldReturn` zip [0 ..] "abcd"

olderThan :: Spec
olderThan = do
  prop "is true while the time is at least that long ago" $
    forAll ((,) <$> choose (0, 6 :: Int) <*> script) $ \(whole, steps) -> ioProperty $ do
      let limit = fromIntegral whole + 0.37
          stamps =
            scanl1
              (\(_, before) (t, stamp) -> (t, max before stamp))
              [(t, t - fromIntegral (2 * back)) | (t, back) <- steps]
      (=== ages limit stamps) <$> observed (\stamp -> (,) <$> stamp <*> Signal.olderThan limit stamp) stamps

  it "judges a time that is earlier than the one before at once" $ do
    stamp <- newTVarIO 0
    let changing = sleep 1 >> atomically (writeTVar stamp (-9))
    run <- simulate (Signal.waitUntil (Signal.olderThan 5 (watchedVar stamp)) ||| (changing >> hang))
    finished run `shouldBe` 1

  it "faults as soon as the time is NaN" $ do
    stamp <- newTVarIO 0
    end <- newIORef Nothing
    let changing = sleep 1 >> atomically (writeTVar stamp (0 / 0))
    run <- simulate $
      ending (Signal.waitUntil (Signal.olderThan 5 (watchedVar stamp)) ||| (changing >> hang))
        >>= writeIORef end . Just
    finished run `shouldBe` 1
    readIORef end `shouldReturn` Just (FaultedWith "olderThan: a point in time is a number, not NaN")

  it "is never true with an infinite limit, or for a time in the future" $
    for_ [(1 / 0, 0), (1, 1 / 0)] $ \(limit, ahead) -> do
      t <- now
      Signal.rSelect (Signal.olderThan limit (pure (t + ahead))) (pure "old") (pure "new") `shouldReturn` "new"

  it "faults with a time that is NaN" $
    ending (Signal.waitUntil (Signal.olderThan 1 (pure (0 / 0))))
      `shouldReturn` FaultedWith "olderThan: a point in time is a number, not NaN"

  for_ [SensorFailure, SensorFault, NoValue] $ \newState ->
    it ("does not wait when the new state of its signal is " ++ show newState) $ do
      condition <- newTestCondition True
      t <- now
      let signal = Signal.olderThan (1 / 0) (t <$ watched condition)
      ending (Signal.rSelect signal (pure ()) (set condition newState >> hang)) `shouldReturn` sensorEnds newState

  it "refuses a negative number and NaN, and nothing starts" $
    refusing "olderThan" (\seconds -> Signal.olderThan seconds . fmap (const 0))

-- | Whether, in one of the schedules, a robot that waits for the driver's report of a new place waits
-- for ever. It gets the signal of the place, and one that is true for the instant of the report.
missing :: (Signal Char -> Signal Bool -> Signal Bool) -> IO Bool
missing signal = do
  missed <- newIORef False
  _ <- explore (randomly 100) $ \simulated -> do
    place <- newTVarIO 'a'
    fresh <- newTVarIO False
    let driver =
          sleep 1 >> atomically (writeTVar place 'b' >> writeTVar fresh True) >> atomically (writeTVar fresh False)
        robot = Signal.waitUntil (signal (watchedVar place) (watchedVar fresh))
    run <- simulated (robot ||| (driver >> sleep 9))
    when (finished run > 1) (writeIORef missed True)
  readIORef missed

naming :: Spec
naming = do
  it "is reported by whileHolding, for each signal that the condition is made of" $
    for_
      [ (level, "")
      , (battery, ": battery")
      , (Signal.named "charged" battery, ": charged")
      , ((&&) <$> battery <*> Signal.named "calm" level, ": battery, calm")
      , ((&&) <$> battery <*> battery, ": battery")
      , (Signal.debounce 1 battery, ": battery")
      , (Signal.named "bumper" (Signal.polling 1 (pure False)), ": bumper")
      ]
      $ \(signal, reason) ->
        ending (Signal.whileHolding signal hang)
          `shouldReturn` (FailedWith ("FailedBecause " ++ show ("the condition does not hold" ++ reason)) :: Ending ())
  it "is that of a shared signal, too" $
    ending (Signal.withShared battery (`Signal.whileHolding` hang))
      `shouldReturn` (FailedWith "FailedBecause \"the condition does not hold: battery\"" :: Ending ())
 where
  level = pure False
  battery = Signal.named "battery" level

-- | To plan a path takes five seconds; a plan is wanted at 0, 10 and 20 s.
replanning :: Spec
replanning = do
  it "stands still only during the first planning, if the planner runs beside the switch" $
    standing (\wanted plan path fly -> forever (Signal.waitUntil wanted >> plan) ||| Signal.switch path fly)
      `shouldReturn` 5
  it "stands still during each, if planning interrupts the flight" $
    standing (\wanted plan path fly -> Signal.monitor wanted plan (Signal.read path >>= fly)) `shouldReturn` 15

-- | For how many of 30 seconds the drone does not fly.
standing :: (Signal Bool -> Behavior () -> Signal Int -> (Int -> Behavior ()) -> Behavior ()) -> IO Seconds
standing mission = do
  wanted <- newTVarIO False
  path <- newTVarIO Nothing
  flying <- newTVarIO 0
  let plan = sleep 5 >> atomically (writeTVar wanted False >> modifyTVar' path (Just . maybe 1 (+ 1)))
      fly _ = now >>= \t -> hang `onException` (now >>= \t' -> atomically (modifyTVar' flying (+ (t' - t))))
      wishes = for_ [0, 10, 20] (\t -> sleepUntil t >> atomically (writeTVar wanted True)) >> sleepUntil 30
  _ <- simulate (mission (watchedVar wanted) plan (Signal.watching (readTVar path >>= maybe retry pure)) fly ||| wishes)
  (30 -) <$> readTVarIO flying

-- * What is observed, and what is expected

-- | A script: values, each from a time on.
type Timed a = [(Seconds, a)]

-- | At whole seconds.
script :: Gen (Timed Int)
script = do
  pauses <- listOf1 (choose (1, 6 :: Int))
  values <- traverse (const (choose (0, 2))) pauses
  pure (zip (scanl (+) 0 (map fromIntegral pauses)) values)

-- | When a signal of a scripted variable changes, and to what.
observed :: Eq b => (Signal a -> Signal b) -> Timed a -> IO (Timed b)
observed filtering steps = do
  seen <- newLog
  level <- newTVarIO (snd (head steps))
  let playing = for_ (drop 1 steps) $ \(t, value) -> sleepUntil t >> atomically (writeTVar level value)
      record value = now >>= \t -> note seen (t, value) >> hang
  _ <- simulate (Signal.switch (filtering (watchedVar level)) record ||| (playing >> sleep 30))
  notes seen

-- | What 'Signal.throttle' should give.
throttled :: Seconds -> Timed Int -> Timed Int
throttled seconds = \case
  [] -> []
  (t, value) : later ->
    let restsUntil = t + seconds
        (meanwhile, after) = span ((<= restsUntil) . fst) later
        latest = last (value : map snd meanwhile)
        others = if latest /= value then (restsUntil, latest) : after else dropWhile ((== value) . snd) after
     in (t, value) : throttled seconds others

-- | What 'Signal.changes' should give.
counted :: Timed Int -> Timed Int
counted steps = zip (map fst (distinct steps)) [0 ..]

-- | What 'Signal.olderThan' should give.
ages :: Seconds -> Timed Seconds -> Timed (Seconds, Bool)
ages limit steps = distinct (concat (zipWith judge steps (map fst (drop 1 steps) ++ [1 / 0])))
 where
  judge (t, stamp) next
    | stamp + limit <= t = [(t, (stamp, True))]
    | otherwise = (t, (stamp, False)) : [(stamp + limit, (stamp, True)) | stamp + limit < next]

-- | Without the values that are equal to the one before.
distinct :: Eq a => Timed a -> Timed a
distinct = map head . groupBy (\a b -> snd a == snd b)

-- | How an operator ends when its condition has this state.
sensorEnds :: ConditionState -> Ending ()
sensorEnds = \case
  SensorFailure -> FailedWith "FailedBecause \"the sensor\""
  SensorFault -> FaultedWith (show (Fault "the sensor"))
  _ -> FailedWith "FailedBecause \"the signal has no value any more\""

refusing :: String -> (Seconds -> Signal Bool -> Signal Bool) -> IO ()
refusing name filtering =
  for_ [(-1, "-1.0"), (0 / 0, "NaN")] $ \(seconds, shown) -> do
    entries <- newLog
    let signal = filtering seconds (Signal.polling 0.001 (True <$ note entries "reading"))
    ending (Signal.rSelect signal (note entries "left") (note entries "right"))
      `shouldReturn` FaultedWith (name ++ ": a duration is zero or more seconds, not " ++ shown)
    notes entries `shouldReturn` []
