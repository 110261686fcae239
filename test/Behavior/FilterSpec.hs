{-# LANGUAGE LambdaCase #-}

-- |
-- Signals made more exact: 'Signal.hysteresis' and 'Signal.debounce'.
module Behavior.FilterSpec (spec) where

import Control.Concurrent (myThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception (throwIO)
import Control.Monad (replicateM_, unless, void)
import Data.Foldable (for_)
import Test.Hspec hiding (after, before)
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck (choose, forAll, ioProperty, listOf1, (===))

import Behavior (Seconds, (|||))
import Behavior.Internal.Runtime (atomically, now, sleep)
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Sim (Run (finished), explore, randomly, simulate)
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "hysteresis" hysteresis
  describe "debounce" debounce
  for_ [("hysteresis", Signal.hysteresis False False True), ("debounce", Signal.debounce 1)] $ \(name, refined) ->
    it (name ++ " goes on after what its signal throws while no operator reads it") $ do
      book <- newLog
      condition <- newTestCondition True
      _ <- simulate . Signal.withShared (refined (watched condition)) $ \signal -> do
        Signal.switch signal (note book)
        for_ [SaysFault, Says False] $ \says' -> atomically (writeTVar condition says') >> sleep 2
        Signal.switch signal (note book)
      notes book `shouldReturn` [True, False]

hysteresis :: Spec
hysteresis = do
  it "keeps its first state between the thresholds" $
    for_ [False, True] $ \initial ->
      Signal.switch (Signal.hysteresis initial 20 80 (pure (50 :: Int))) pure `shouldReturn` initial

  it "keeps its state from one operator to the next, where it is shared" $ do
    level <- newTVarIO (90 :: Int)
    Signal.withShared (Signal.hysteresis False 20 80 (dialled level)) $ \charged -> do
      Signal.switch charged pure `shouldReturn` True
      atomically (writeTVar level 50)
      Signal.switch charged pure `shouldReturn` True
    Signal.switch (Signal.hysteresis False 20 80 (dialled level)) pure `shouldReturn` False

  prop "is a fold over the values that were seen" $
    forAll ((,) <$> thresholds <*> listOf1 (choose (0, 10))) $ \((low, high), levels) ->
      ioProperty $ do
        book <- newLog
        position <- newTVarIO (0 :: Int)
        let level = (levels !!) <$> dialled position
            signal = (,) <$> dialled position <*> Signal.hysteresis False low high level
            branch (n, state) = do
              note book state
              unless (n + 1 == length levels) $ do
                atomically (writeTVar position (n + 1))
                hang
        Signal.switch signal branch
        let next state value = value >= high || (state && value > low)
        (drop 1 (scanl next False levels) ===) <$> notes book

  it "remembers what its operator has acted on, before any other value can be seen" $
    replicateM_ 200 $ do
      level <- newRecorded (95 :: Int)
      self <- myThreadId
      let left = do
            atomically (writeTVar (underlying level) 50)
            eventually ((>= 1) <$> looks level (== self) 50)
            pure "left"
      Signal.rSelect (Signal.hysteresis False 10 90 (recorded level)) left (pure "right")
        `shouldReturn` "left"

  for_ [("rose", False, 0, 95), ("fell", True, 95, 0)] $ \(manner, initial, start, changed) ->
    it ("remembers also what " ++ manner ++ " and changed nothing for its operator") $ do
      book <- newLog
      level <- newRecorded (start :: Int)
      armed <- newTVarIO False
      entered <- newGate
      let signal = (&&) <$> dialled armed <*> ((/= initial) <$> Signal.hysteresis initial 10 90 (recorded level))
          recovery = note book "recovery" >> atomically (writeTVar (underlying level) start)
          task = do
            note book "task"
            again <- (> 1) . length <$> notes book
            unless again (open entered >> hang)
      launching (Signal.monitor signal recovery task) $ \caller -> do
        pass entered
        atomically (writeTVar (underlying level) changed)
        noticed level caller changed
        atomically (writeTVar (underlying level) 50 >> writeTVar armed True)
        awaitEnd caller `shouldReturn` Gave ()
      notes book `shouldReturn` ["task", "recovery", "task"]

  it "keeps its memory across recoveries" $ do
    book <- newLog
    level <- newTVarIO (95 :: Int)
    let cool = do
          note book =<< readTVarIO level
          atomically (modifyTVar' level (subtract 30))
    Signal.monitor (Signal.hysteresis False 10 90 (dialled level)) cool (pure ())
    notes book `shouldReturn` [95, 65, 35]

  it "decides on the first reading, however long the period" $
    replicateM_ 200 $
      Signal.rSelect (Signal.hysteresis False 0 1 once) (pure "left") (pure "right")
        `shouldReturn` "left"

  it "refuses thresholds the wrong way round, and nothing starts" $ do
    book <- newLog
    let signal = Signal.hysteresis False 2 1 (Signal.polling 0.001 ((1 :: Int) <$ note book "reading"))
    ending (Signal.rSelect signal (note book "left") (note book "right"))
      `shouldReturn` FaultedWith "hysteresis: the lower threshold must be at most the upper one"
    notes book `shouldReturn` []
 where
  thresholds = do
    a <- choose (0, 10 :: Int)
    b <- choose (0, 10)
    pure (min a b, max a b)

-- | A sensor that is read but once.
once :: Signal Int
once = Signal.polling (1 / 0) (pure 1)

debounce :: Spec
debounce = do
  it "counts its first value at once" $
    replicateM_ 200 $
      Signal.rSelect (Signal.debounce (1 / 0) (pure True)) (pure "left") (pure "right")
        `shouldReturn` "left"

  it "decides on the first reading, however long the period" $
    replicateM_ 200 $
      Signal.switch (Signal.debounce (1 / 0) once) pure `shouldReturn` 1

  it "counts a change once it has lasted for so long, and no sooner" $ do
    condition <- newTestCondition True
    entered <- newGate
    launching (Signal.rSelect (Signal.debounce 0.005 (watched condition)) (open entered >> hang) now) $
      \caller -> do
        pass entered
        since <- now
        set condition (Says False)
        Gave over <- awaitEnd caller
        over - since `shouldSatisfy` (>= 0.005)

  for_ [("back and forth", [1, 0]), ("on and on", [1 ..])] $ \(manner, values) ->
    it ("counts no value of those that go " ++ manner ++ " too fast") $ do
      (value, counted, phases) <- flickering 0.002 (cycle values)
      -- A value that counted had lasted: from just before it was set until the next one
      -- was noticed. (Which one that is depends on the machine.)
      phases `shouldSatisfy` any (\(v, from, to) -> v == value && min to counted - from >= 0.002)

  it "counts at once the first value after a recovery" $ do
    condition <- newTestCondition True
    Signal.monitor (Signal.debounce (1 / 0) (watched condition)) (set condition (Says False)) (pure "task")
      `shouldReturn` "task"

  it "counts at once the first value after a recovery, and not the one before, under any schedule" $
    void . explore (randomly 200) $ \simulated -> do
      book <- newLog
      level <- newTVarIO True
      let recovery = note book "recovery" >> atomically (writeTVar level False)
      run <- simulated (Signal.monitor (Signal.debounce 1 (dialled level)) recovery (note book "task"))
      finished run `shouldBe` 0
      notes book `shouldReturn` ["recovery", "task"]

  it "forgets at a recovery a change that had not lasted" $ do
    book <- newLog
    alarm <- newTVarIO False
    level <- newTVarIO False
    let recovery = note book "recovery" >> atomically (writeTVar alarm False >> writeTVar level False)
        task = note book "task" >> sleep 10
        changes = for_ [level, alarm] $ \var -> sleep 0.5 >> atomically (writeTVar var True)
        signal = (||) <$> dialled alarm <*> Signal.debounce 1 (dialled level)
    run <- simulate (Signal.monitor signal recovery task ||| (changes >> hang))
    finished run `shouldBe` 11
    notes book `shouldReturn` ["task", "recovery", "task"]

  it "counts a change from when it came last" $ do
    level <- newTVarIO (0 :: Int)
    let flicker = for_ [(1, 1), (0.5, 0), (0.25, 1)] $ \(pause, value) -> sleep pause >> atomically (writeTVar level value)
    run <- simulate (Signal.waitUntil (Signal.debounce 1 ((== 1) <$> dialled level)) ||| (flicker >> hang))
    finished run `shouldBe` 2.75

  it "of no duration follows its signal" $ do
    condition <- newTestCondition True
    let left = set condition (Says False) >> hang
    Signal.rSelect (Signal.debounce 0 (watched condition)) left (pure "right") `shouldReturn` "right"

  for_ [SaysFailure, SaysFault, SaysNothing] $ \news ->
    it ("does not wait, when its signal " ++ show news) $ do
      condition <- newTestCondition True
      let left = set condition news >> hang
      ending (Signal.rSelect (Signal.debounce (1 / 0) (watched condition)) left (pure ()))
        `shouldReturn` case news of
          SaysFailure -> FailedWith "FailedBecause \"the sensor\""
          SaysFault -> FaultedWith (show (Fault "the sensor"))
          _ -> FailedWith "FailedBecause \"the signal has no value any more\""

  for_ [(-1, "-1.0"), (0 / 0, "NaN")] $ \(seconds, shown) ->
    it ("refuses a duration of " ++ shown ++ ", and nothing starts") $ do
      book <- newLog
      let signal = Signal.debounce seconds (Signal.polling 0.001 (True <$ note book "reading"))
      ending (Signal.rSelect signal (note book "left") (note book "right"))
        `shouldReturn` FaultedWith ("debounce: a duration is zero or more seconds, not " ++ shown)
      notes book `shouldReturn` []

-- | Sets one value after the other, each once the last was noticed, until well after
-- the first could have counted; then leaves it at one that is not the first. Says which
-- value came to count and when; and of all values from when to when there was each.
flickering :: Seconds -> [Int] -> IO (Int, Seconds, [(Int, Seconds, Seconds)])
flickering lasting values = do
  level <- newRecorded 0
  entered <- newGate
  counted <- newGate
  let branch 0 = open entered >> hang
      branch value = now >>= \t -> (value, t) <$ open counted
  launching (Signal.switch (Signal.debounce lasting (recorded level)) branch) $ \caller -> do
    pass entered
    begin <- now
    let setting value = do
          from <- now
          atomically (writeTVar (underlying level) value)
          eventually $ (||) <$> opened counted <*> hasNoticed level caller value
          (,,) value from <$> now
        flicker phases = \case
          value : others | value == 0 -> setting value >>= \phase -> flicker (phase : phases) others
          value : others -> do
            phase <- setting value
            over <- (||) <$> opened counted <*> ((> begin + 3 * lasting) <$> now)
            if over then pure (phase : phases) else flicker (phase : phases) others
          [] -> pure phases
    phases <- reverse <$> flicker [] values
    end <- awaitEnd caller
    over <- now
    case end of
      Gave (value, t) -> pure (value, t, zipWith until' phases (map noticedAt (drop 1 phases) ++ [over]))
      _ -> throwIO (userError ("it ended with " ++ show end))
 where
  noticedAt (_, _, t) = t
  until' (value, from, _) to = (value, from, to)
