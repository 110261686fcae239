{-# LANGUAGE LambdaCase #-}

-- |
-- Filters of signals: 'Signal.hysteresis' and 'Signal.debounce'.
module Behavior.FilterSpec (spec) where

import Control.Concurrent (myThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception (throwIO)
import Control.Monad (replicateM_, unless)
import Data.Foldable (for_)
import Test.Hspec hiding (after, before)
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck (choose, forAll, ioProperty, listOf1, (===))

import Behavior (Seconds, (|||))
import Behavior.Internal.Seam.Runtime (atomically, now, sleep)
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Sim (Run (finished, outcome), explain, simulate)
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "hysteresis" hysteresis
  describe "debounce" debounce
  for_ [("hysteresis", Signal.hysteresis False False True), ("debounce", Signal.debounce 1)] $ \(name, refined) ->
    it (name ++ " continues after an exception of its signal while no operator reads it") $ do
      entries <- newLog
      condition <- newTestCondition True
      _ <- simulate . Signal.withShared (refined (watched condition)) $ \signal -> do
        Signal.switch signal (note entries)
        for_ [SensorFault, Value False] $ \newState -> atomically (writeTVar condition newState) >> sleep 2
        Signal.switch signal (note entries)
      notes entries `shouldReturn` [True, False]

hysteresis :: Spec
hysteresis = do
  it "keeps its initial state between the thresholds" $
    for_ [False, True] $ \initial ->
      Signal.read (Signal.hysteresis initial 20 80 (pure (50 :: Int))) `shouldReturn` initial

  it "keeps its state from one operator to the next, where it is shared" $ do
    level <- newTVarIO (90 :: Int)
    Signal.withShared (Signal.hysteresis False 20 80 (watchedVar level)) $ \charged -> do
      Signal.read charged `shouldReturn` True
      atomically (writeTVar level 50)
      Signal.read charged `shouldReturn` True
    Signal.read (Signal.hysteresis False 20 80 (watchedVar level)) `shouldReturn` False

  prop "is a fold over the values that were read" $
    forAll ((,) <$> thresholds <*> listOf1 (choose (0, 10))) $ \((low, high), levels) ->
      ioProperty $ do
        entries <- newLog
        position <- newTVarIO (0 :: Int)
        let level = (levels !!) <$> watchedVar position
            signal = (,) <$> watchedVar position <*> Signal.hysteresis False low high level
            branch (n, state) = do
              note entries state
              unless (n + 1 == length levels) $ do
                atomically (writeTVar position (n + 1))
                hang
        Signal.switch signal branch
        let next state value = value >= high || (state && value > low)
        (drop 1 (scanl next False levels) ===) <$> notes entries

  it "remembers the value that its operator has acted on, before another value can be read" $
    replicateM_ 200 $ do
      level <- newRecorded (95 :: Int)
      self <- myThreadId
      let left = do
            atomically (writeTVar (underlying level) 50)
            eventually ((>= 1) <$> readCount level (== self) 50)
            pure "left"
      Signal.rSelect (Signal.hysteresis False 10 90 (recorded level)) left (pure "right")
        `shouldReturn` "left"

  for_ [("rose", False, 0, 95), ("fell", True, 95, 0)] $ \(manner, initial, start, changed) ->
    it ("remembers also a value that " ++ manner ++ " without an effect on its operator") $ do
      entries <- newLog
      level <- newRecorded (start :: Int)
      armed <- newTVarIO False
      entered <- newGate
      let signal = (&&) <$> watchedVar armed <*> ((/= initial) <$> Signal.hysteresis initial 10 90 (recorded level))
          recovery = note entries "recovery" >> atomically (writeTVar (underlying level) start)
          task = do
            note entries "task"
            again <- (> 1) . length <$> notes entries
            unless again (open entered >> hang)
      withThread (Signal.monitor signal recovery task) $ \caller -> do
        pass entered
        atomically (writeTVar (underlying level) changed)
        awaitProcessed level caller changed
        atomically (writeTVar (underlying level) 50 >> writeTVar armed True)
        awaitEnd caller `shouldReturn` Gave ()
      notes entries `shouldReturn` ["task", "recovery", "task"]

  for_ [(False, [95, 0, 50]), (True, [0, 95, 50])] $ \(initial, levels) ->
    it ("forgets a value that changed, and back, without an effect on its operator, from " ++ show initial) $ do
      entries <- newLog
      level <- newTVarIO (50 :: Int)
      armed <- newTVarIO False
      let signal = (&&) <$> watchedVar armed <*> ((/= initial) <$> Signal.hysteresis initial 10 90 (watchedVar level))
          changes = for_ levels $ \l -> sleep 1 >> atomically (writeTVar level l)
      _ <- simulate $
        Signal.switch signal (\s -> note entries s >> hang)
          ||| (changes >> sleep 1 >> atomically (writeTVar armed True) >> sleep 1)
      notes entries `shouldReturn` [False]

  it "keeps its memory across recoveries" $ do
    entries <- newLog
    level <- newTVarIO (95 :: Int)
    let cool = do
          note entries =<< readTVarIO level
          atomically (modifyTVar' level (subtract 30))
    Signal.monitor (Signal.hysteresis False 10 90 (watchedVar level)) cool (pure ())
    notes entries `shouldReturn` [95, 65, 35]

  it "decides on the first reading, however long the period" $
    replicateM_ 200 $
      Signal.rSelect (Signal.hysteresis False 0 1 once) (pure "left") (pure "right")
        `shouldReturn` "left"

  it "refuses a lower threshold above the upper one, and nothing starts" $ do
    entries <- newLog
    let signal = Signal.hysteresis False 2 1 (Signal.polling 0.001 ((1 :: Int) <$ note entries "reading"))
    ending (Signal.rSelect signal (note entries "left") (note entries "right"))
      `shouldReturn` FaultedWith "hysteresis: the lower threshold must be at most the upper one"
    notes entries `shouldReturn` []
 where
  thresholds = do
    a <- choose (0, 10 :: Int)
    b <- choose (0, 10)
    pure (min a b, max a b)

-- | A sensor that is read only once.
once :: Signal Int
once = Signal.polling (1 / 0) (pure 1)

debounce :: Spec
debounce = do
  it "accepts its first value at once" $
    replicateM_ 200 $
      Signal.rSelect (Signal.debounce (1 / 0) (pure True)) (pure "left") (pure "right")
        `shouldReturn` "left"

  it "decides on the first reading, however long the period" $
    replicateM_ 200 $
      Signal.read (Signal.debounce (1 / 0) once) `shouldReturn` 1

  it "accepts a change once it has lasted for the duration, and no sooner" $ do
    condition <- newTestCondition True
    entered <- newGate
    withThread (Signal.rSelect (Signal.debounce 0.005 (watched condition)) (open entered >> hang) now) $
      \caller -> do
        pass entered
        since <- now
        set condition (Value False)
        Gave over <- awaitEnd caller
        over - since `shouldSatisfy` (>= 0.005)

  for_ [("alternate", [1, 0]), ("are all different", [1 ..])] $ \(manner, values) ->
    it ("accepts no value that is replaced too soon, when the values " ++ manner) $ do
      (value, accepted, phases) <- flickering 0.002 (cycle values)
      -- The accepted value had lasted, from just before it was set until the next one was
      -- read. (Which value that is depends on the machine.)
      phases `shouldSatisfy` any (\(v, from, to) -> v == value && min to accepted - from >= 0.002)

  it "accepts no value that was another one meanwhile" $ do
    run <- simulate $ do
      level <- newTVarIO False
      let changes = for_ [1, 0.6, 0.2] $ \pause -> sleep pause >> atomically (modifyTVar' level not)
      (changes >> hang) ||| Signal.waitUntil (Signal.debounce 1 (watchedVar level))
    (explain (outcome run), finished run) `shouldBe` ("it returned", 2.8)

  it "measures from the newest of several values, none of which has lasted" $ do
    run <- simulate $ do
      level <- newTVarIO (0 :: Int)
      let changes = for_ [1, 0.6] $ \pause -> sleep pause >> atomically (modifyTVar' level (+ 1))
      (changes >> hang) ||| Signal.waitUntil ((== 2) <$> Signal.debounce 1 (watchedVar level))
    (explain (outcome run), finished run) `shouldBe` ("it returned", 2.6)

  it "accepts at once the first value after a recovery" $ do
    condition <- newTestCondition True
    Signal.monitor (Signal.debounce (1 / 0) (watched condition)) (set condition (Value False)) (pure "task")
      `shouldReturn` "task"

  it "accepts at once the first value after a recovery, and not the one before, under any schedule" $
    beginsAfreshAtARecovery (Signal.debounce 1)

  it "discards at a recovery a change that had not lasted" $ do
    entries <- newLog
    alarm <- newTVarIO False
    level <- newTVarIO False
    let recovery = note entries "recovery" >> atomically (writeTVar alarm False >> writeTVar level False)
        task = note entries "task" >> sleep 10
        changes = for_ [level, alarm] $ \var -> sleep 0.5 >> atomically (writeTVar var True)
        signal = (||) <$> watchedVar alarm <*> Signal.debounce 1 (watchedVar level)
    run <- simulate (Signal.monitor signal recovery task ||| (changes >> hang))
    finished run `shouldBe` 11
    notes entries `shouldReturn` ["task", "recovery", "task"]

  it "measures a change from its last occurrence" $ do
    level <- newTVarIO (0 :: Int)
    let flicker =
          for_ [(1, 1), (0.5, 0), (0.25, 1)] $ \(pause, value) -> sleep pause >> atomically (writeTVar level value)
    run <- simulate (Signal.waitUntil (Signal.debounce 1 ((== 1) <$> watchedVar level)) ||| (flicker >> hang))
    finished run `shouldBe` 2.75

  it "of duration zero follows its signal" $ do
    condition <- newTestCondition True
    let left = set condition (Value False) >> hang
    Signal.rSelect (Signal.debounce 0 (watched condition)) left (pure "right") `shouldReturn` "right"

  for_ [SensorFailure, SensorFault, NoValue] $ \newState ->
    it ("does not wait when the new state of its signal is " ++ show newState) $ do
      condition <- newTestCondition True
      let left = set condition newState >> hang
      ending (Signal.rSelect (Signal.debounce (1 / 0) (watched condition)) left (pure ()))
        `shouldReturn` case newState of
          SensorFailure -> FailedWith "FailedBecause \"the sensor\""
          SensorFault -> FaultedWith (show (Fault "the sensor"))
          _ -> FailedWith "FailedBecause \"the signal has no value any more\""

  for_ [(-1, "-1.0"), (0 / 0, "NaN")] $ \(seconds, shown) ->
    it ("refuses a duration of " ++ shown ++ ", and nothing starts") $ do
      entries <- newLog
      let signal = Signal.debounce seconds (Signal.polling 0.001 (True <$ note entries "reading"))
      ending (Signal.rSelect signal (note entries "left") (note entries "right"))
        `shouldReturn` FaultedWith ("debounce: a duration is zero or more seconds, not " ++ shown)
      notes entries `shouldReturn` []

-- | Sets one value after the other, each once the previous one was read, until well after
-- the first could have been accepted; the last value set is not the first. Returns which
-- value was accepted and when, and each value with the time from its setting until the next
-- one was read.
flickering :: Seconds -> [Int] -> IO (Int, Seconds, [(Int, Seconds, Seconds)])
flickering lasting values = do
  level <- newRecorded 0
  entered <- newGate
  accepted <- newGate
  let branch 0 = open entered >> hang
      branch value = now >>= \t -> (value, t) <$ open accepted
  withThread (Signal.switch (Signal.debounce lasting (recorded level)) branch) $ \caller -> do
    pass entered
    begin <- now
    let setting value = do
          from <- now
          atomically (writeTVar (underlying level) value)
          eventually $ (||) <$> opened accepted <*> hasProcessed level caller value
          (,,) value from <$> now
        flicker phases = \case
          value : others | value == 0 -> setting value >>= \phase -> flicker (phase : phases) others
          value : others -> do
            phase <- setting value
            over <- (||) <$> opened accepted <*> ((> begin + 3 * lasting) <$> now)
            if over then pure (phase : phases) else flicker (phase : phases) others
          [] -> pure phases
    phases <- reverse <$> flicker [] values
    end <- awaitEnd caller
    over <- now
    case end of
      Gave (value, t) -> pure (value, t, zipWith heldTo phases (map readAt (drop 1 phases) ++ [over]))
      _ -> throwIO (userError ("it ended with " ++ show end))
 where
  readAt (_, _, t) = t
  heldTo (value, from, _) to = (value, from, to)
