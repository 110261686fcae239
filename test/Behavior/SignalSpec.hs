-- |
-- What can be watched: 'Signal.watching', signals made of several,
-- 'Signal.debounce', 'Signal.hysteresis' and 'Signal.withShared'. Polling has a spec of
-- its own.
module Behavior.SignalSpec (spec) where

import Control.Concurrent (ThreadId, myThreadId)
import Control.Concurrent.Async (Async, asyncThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (replicateM_, unless)
import Data.Foldable (for_)
import Data.IORef (atomicModifyIORef', newIORef, readIORef)
import GHC.Conc (unsafeIOToSTM)
import Test.Hspec hiding (after, before)
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck (choose, forAll, ioProperty, listOf1, vectorOf, (===))

import Behavior (Seconds, both, (?))
import Behavior.Internal.Runtime (Event (..), Label (..), atomically, now, reportingTo)
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "watching" watchingIt
  describe "A signal made of several" several
  describe "hysteresis" hysteresis
  describe "debounce" debounce
  describe "withShared" sharing

watchingIt :: Spec
watchingIt = do
  it "waits for a first value, and later takes its absence for an end" $ do
    dial <- newTVarIO SaysNothing
    entered <- newGate
    launching (Signal.rSelect (watched dial) (open entered >> hang) hang) $ \caller -> do
      stillRunning caller
      set dial (Says True)
      pass entered
      set dial SaysNothing
      awaitEnd caller `shouldReturn` lost

  it "is not misled by a value that is back by the time it looks" $ do
    dial <- newDial True
    entered <- newGate
    let branch = open entered >> atomically (readTVar dial >>= check . (== Says False)) >> hang
        -- The value goes and comes in one transaction: nobody can see it gone.
        flicker = atomically (writeTVar dial SaysNothing >> writeTVar dial (Says True))
    launching (Signal.rSelect (watched dial) branch (pure "right")) $ \caller -> do
      pass entered
      flicker
      stillRunning caller
      set dial (Says False)
      awaitEnd caller `shouldReturn` Gave "right"
 where
  lost = FailedWith "FailedBecause \"the signal has no value any more\"" :: Ending ()

several :: Spec
several = do
  prop "a pure one is the function applied to the values" $ \f x y ->
    let g = if f then (+) else (-) :: Int -> Int -> Int
     in ioProperty $ (=== g x y) <$> Signal.switch (g <$> pure x <*> pure y) pure

  it "has a value when each has one" $ do
    first <- newTVarIO Nothing
    second <- newTVarIO Nothing
    let given variable = Signal.watching (readTVar variable >>= maybe retry pure)
    launching (Signal.switch ((,) <$> given first <*> given second) pure) $ \caller -> do
      stillRunning caller
      atomically (writeTVar first (Just 'a'))
      stillRunning caller
      atomically (writeTVar second (Just 'b'))
      awaitEnd caller `shouldReturn` Gave ('a', 'b')

  it "changes once when one transaction changes several" $ do
    book <- newNotebook
    first <- newTVarIO (0 :: Int)
    second <- newTVarIO (0 :: Int)
    let branch key = do
          note book key
          unless (fst key == 50) $ do
            atomically (modifyTVar' first (+ 1) >> modifyTVar' second (+ 1))
            hang
    Signal.switch ((,) <$> dialled first <*> dialled second) branch
    notes book `shouldReturn` [(n, n) | n <- [0 .. 50]]

  it "asks a sensor once for each of its occurrences" $ do
    level <- newSensor pure
    polled <- started (Signal.waitUntil ((\a b c -> a + b + c > 6) <$> sensing level <*> sensing level <*> sensing level))
    polled `shouldBe` replicate 3 (Label "waitUntil" "polling")

  it "can differ from itself, when it is not shared" $ do
    -- Each reading is another; so two sensors' readings never agree.
    level <- newSensor pure
    Signal.waitUntil ((/=) <$> sensing level <*> sensing level)

-- | The labels of the threads that an action starts.
started :: IO a -> IO [Label]
started act = do
  events <- newNotebook
  _ <- reportingTo (note events) act
  notes events >>= \all' -> pure [label | Started label <- all']

hysteresis :: Spec
hysteresis = do
  prop "is a fold over the values that were seen" $
    forAll ((,) <$> thresholds <*> listOf1 (choose (0, 10))) $ \((low, high), levels) ->
      ioProperty $ do
        book <- newNotebook
        position <- newTVarIO (0 :: Int)
        let level = (levels !!) <$> dialled position
            signal = (,) <$> dialled position <*> Signal.hysteresis low high level
            branch (n, state) = do
              note book state
              unless (n + 1 == length levels) $ do
                atomically (writeTVar position (n + 1))
                hang
        Signal.switch signal branch
        let next state value = value >= high || (state && value > low)
        (tail (scanl next False levels) ===) <$> notes book

  it "remembers what its operator has acted on, before any other value can be seen" $
    replicateM_ 200 $ do
      level <- newRecorded (95 :: Int)
      self <- myThreadId
      let left = do
            atomically (writeTVar (variable level) 50)
            eventually ((>= 1) <$> looks level (== self) 50)
            pure "left"
      Signal.rSelect (Signal.hysteresis 10 90 (recorded level)) left (pure "right")
        `shouldReturn` "left"

  it "remembers also what changed nothing for its operator" $ do
    book <- newNotebook
    level <- newRecorded (0 :: Int)
    armed <- newTVarIO False
    entered <- newGate
    let signal = (&&) <$> dialled armed <*> Signal.hysteresis 10 90 (recorded level)
        cool = note book "cool" >> atomically (writeTVar (variable level) 10)
        task = do
          note book "task"
          again <- (> 1) . length <$> notes book
          unless again (open entered >> hang)
    launching (Signal.monitor signal cool task) $ \caller -> do
      pass entered
      atomically (writeTVar (variable level) 95)
      noticed level caller 95
      atomically (writeTVar (variable level) 50 >> writeTVar armed True)
      awaitEnd caller `shouldReturn` Gave ()
    notes book `shouldReturn` ["task", "cool", "task"]

  it "keeps its memory across recoveries" $ do
    book <- newNotebook
    level <- newTVarIO (95 :: Int)
    let cool = do
          note book =<< readTVarIO level
          atomically (modifyTVar' level (subtract 30))
    Signal.monitor (Signal.hysteresis 10 90 (dialled level)) cool (pure ())
    notes book `shouldReturn` [95, 65, 35]

  it "refuses thresholds the wrong way round, and nothing starts" $ do
    book <- newNotebook
    let signal = Signal.hysteresis 2 1 (Signal.polling 0.001 (1 <$ note book "reading"))
    ending (Signal.rSelect signal (note book "left") (note book "right"))
      `shouldReturn` FaultedWith "hysteresis: the lower threshold must not be above the upper one"
    notes book `shouldReturn` []
 where
  thresholds = do
    ~[a, b] <- vectorOf 2 (choose (0, 10 :: Int))
    pure (min a b, max a b)

-- | A variable whose signal records who has looked at it.
data Recorded a = Recorded
  { variable :: TVar a
  , recorded :: Signal a
  , looks :: (ThreadId -> Bool) -> a -> IO Int
  -- ^ How often the threads that are meant have looked at it since it has this value.
  }

newRecorded :: Eq a => a -> IO (Recorded a)
newRecorded initial = do
  var <- newTVarIO initial
  seen <- newIORef []
  pure
    Recorded
      { variable = var
      , recorded = Signal.watching $ do
          value <- readTVar var
          unsafeIOToSTM $ do
            self <- myThreadId
            value <$ atomicModifyIORef' seen (\all' -> ((self, value) : all', ()))
      , looks = \meant value ->
          length . takeWhile ((== value) . snd) . filter (meant . fst) <$> readIORef seen
      }

-- | Waits until a worker of the operator that the caller runs has seen the value and
-- done what there is to do: it looks for the second time.
noticed :: Recorded a -> Async b -> a -> IO ()
noticed var caller value = eventually $ (>= 2) <$> looks var (/= asyncThreadId caller) value

debounce :: Spec
debounce = do
  it "counts its first value at once" $
    replicateM_ 200 $
      Signal.rSelect (Signal.debounce (1 / 0) (pure True)) (pure "left") (pure "right")
        `shouldReturn` "left"

  it "counts a change once it has lasted for so long, and no sooner" $ do
    dial <- newDial True
    entered <- newGate
    launching (Signal.rSelect (Signal.debounce 0.005 (watched dial)) (open entered >> hang) now) $
      \caller -> do
        pass entered
        since <- now
        set dial (Says False)
        Gave over <- awaitEnd caller
        over - since `shouldSatisfy` (>= 0.005)

  for_ [("back and forth", [1, 0]), ("on and on", [1 ..])] $ \(manner, values) ->
    it ("counts no value of those that go " ++ manner ++ " too fast") $ do
      (value, counted, phases) <- flickering 0.002 (cycle values)
      -- A value that counted had lasted: from just before it was set until the next one
      -- was noticed. (On a slow machine that can be any.)
      phases `shouldSatisfy` any (\(v, from, to) -> v == value && to - from >= 0.002 && counted - from >= 0.002)

  it "counts at once the first value after a recovery" $ do
    dial <- newDial True
    Signal.monitor (Signal.debounce (1 / 0) (watched dial)) (set dial (Says False)) (pure "task")
      `shouldReturn` "task"

  it "of no duration follows its signal" $ do
    dial <- newDial True
    let left = set dial (Says False) >> hang
    Signal.rSelect (Signal.debounce 0 (watched dial)) left (pure "right") `shouldReturn` "right"

  for_ [SaysFailure, SaysFault, SaysNothing] $ \news ->
    it ("does not wait, when its signal " ++ show news) $ do
      dial <- newDial True
      let left = set dial news >> hang
      ending (Signal.rSelect (Signal.debounce (1 / 0) (watched dial)) left (pure ()))
        `shouldReturn` case news of
          SaysFailure -> FailedWith "FailedBecause \"the sensor\""
          SaysFault -> FaultedWith (show (Fault "the sensor"))
          _ -> FailedWith "FailedBecause \"the signal has no value any more\""

  for_ [(-1, "-1.0"), (0 / 0, "NaN")] $ \(seconds, shown) ->
    it ("refuses a duration of " ++ shown ++ ", and nothing starts") $ do
      book <- newNotebook
      let signal = Signal.debounce seconds (Signal.polling 0.001 (True <$ note book "reading"))
      ending (Signal.rSelect signal (note book "left") (note book "right"))
        `shouldReturn` FaultedWith ("debounce: a duration is zero or more seconds, not " ++ shown)
      notes book `shouldReturn` []

-- | Sets one value after the other, each once the last was noticed, until well after
-- the first could have counted; then leaves it at a value other than the first. Says
-- which value came to count, when, and from when to when there was each.
flickering :: Seconds -> [Int] -> IO (Int, Seconds, [(Int, Seconds, Seconds)])
flickering duration values = do
  level <- newRecorded 0
  entered <- newGate
  counted <- newGate
  let branch 0 = open entered >> hang
      branch value = now >>= \t -> (value, t) <$ open counted
  launching (Signal.switch (Signal.debounce duration (recorded level)) branch) $ \caller -> do
    pass entered
    first <- now
    let settle phases value = do
          from <- now
          atomically (writeTVar (variable level) value)
          Gave (what, when') <- awaitEnd caller
          pure (what, when', reverse ((value, from, when') : phases))
        go phases [] = settle phases 1
        go phases (value : others) = do
          from <- now
          over <- opened counted
          if value /= 0 && (over || from - first > 3 * duration)
            then settle phases value
            else do
              atomically (writeTVar (variable level) value)
              eventually $ (||) <$> opened counted <*> ((>= 2) <$> looks level (/= asyncThreadId caller) value)
              to <- now
              go ((value, from, to) : phases) others
    go [] values

sharing :: Spec
sharing = do
  prop "withShared s b is b s" $ \c l r ->
    let body n s = Signal.rSelect s (play n l) (play n r)
     in (\n -> Signal.withShared (pure c) (body n)) `sameAs` (\n -> body n (pure c))

  it "reads a sensor once for all occurrences, which always agree" $ do
    level <- newSensor pure
    labels <- started . Signal.withShared (sensing level) $ \s ->
      Signal.whileHolding ((==) <$> s <*> s) (readingsBeyond 50 level)
    filter ((== "polling") . labelBranch) labels `shouldBe` [Label "withShared" "polling"]

  it "reads a sensor once for several operators at once" $ do
    level <- newSensor (pure . (> 10))
    labels <- started . Signal.withShared (sensing level) $ \s ->
      both (Signal.waitUntil s) (Signal.waitUntil s)
    filter ((== "polling") . labelBranch) labels `shouldBe` [Label "withShared" "polling"]

  it "goes on reading while an operator inside recovers" $ do
    level <- newSensor pure
    recovered <- newTVarIO False
    Signal.withShared (sensing level) $ \s ->
      Signal.monitor
        ((\n isRecovered -> n > 0 && not isRecovered) <$> s <*> dialled recovered)
        (readingsBeyond 10 level >> atomically (writeTVar recovered True))
        (pure ())

  it "fails each operator that watches a sensor which fails, and nothing else" $ do
    let attempted s = (Signal.waitUntil s >> pure "held") ? pure "failed"
    Signal.withShared (Signal.polling 0.001 (throwIO (Failure "no echo"))) (\s -> (,) <$> attempted s <*> attempted s)
      `shouldReturn` ("failed", "failed")

  it "keeps a memory for all operators inside" $ do
    level <- newTVarIO (95 :: Int)
    Signal.withShared (Signal.hysteresis 10 90 (dialled level)) $ \s -> do
      Signal.waitUntil s
      atomically (writeTVar level 50)
      Signal.rSelect s (pure "left") (pure "right") `shouldReturn` "left"

  for_ [("unmasked", id), ("masked", mask_), ("uninterruptible", uninterruptibleMask_)] $
    \(state, masked) ->
      it ("runs the body unmasked for a caller that is " ++ state) $
        masked (Signal.withShared (pure ()) (const getMaskingState)) `shouldReturn` Unmasked

  for_ [minBound .. maxBound] $ \how ->
    it ("ends its sensors with the body, also one that is " ++ show how) $ do
      entered <- newGate
      level <- newSensor $ \_ -> onStop how "reading" (open entered >> hang)
      end <- ending (Signal.withShared (sensing level) (\_ -> pass entered >> pure "body"))
      end `shouldBe` case how of
        Faulting -> FaultedWith (show (Fault "reading"))
        _ -> Gave "body"

  for_ [minBound .. maxBound] $ \how ->
    it ("is cancelled with its body and sensors, when the body is " ++ show how) $ do
      entered <- newGate
      level <- newSensor (const hang)
      let act = Signal.withShared (sensing level) $ \s ->
            onStop how "body" (open entered >> Signal.waitUntil s >> hang)
      end <- cancelling (leavingNothing act) (pass entered)
      end `shouldBe` case how of
        Faulting -> CancelledWithFault (show (Cancel "the caller")) (show (Fault "body"))
        _ -> CancelledBy (show (Cancel "the caller"))

  it "throws the body's fault before a sensor's" $ do
    entered <- newGate
    level <- newSensor $ \_ -> onStop Faulting "reading" (open entered >> hang)
    ending (Signal.withShared (sensing level) (\_ -> pass entered >> throwIO (Fault "body")))
      `shouldReturn` (FaultedWith (show (Fault "body")) :: Ending ())

  it "is closed when the body has ended: to use it then is a fault, and starts nothing" $ do
    book <- newNotebook
    leaked <- Signal.withShared (pure True) pure
    ending (Signal.rSelect leaked (note book "left") (note book "right")) `shouldReturn` closed
    notes book `shouldReturn` []

  it "closes also for an operator that still watches it from outside" $ do
    leaked <- newEmptyTMVarIO
    watching <- newGate
    over <- newGate
    let body s = atomically (putTMVar leaked s) >> pass watching
        outside = do
          s <- atomically (takeTMVar leaked)
          Signal.rSelect s (open watching >> hang) (pure ()) `onException` open over
    launching outside $ \caller -> do
      Signal.withShared (pure True) body
      awaitEnd caller `shouldReturn` closed
    opened over `shouldReturn` True

  it "refuses a bad signal before it starts the body" $ do
    book <- newNotebook
    ending (Signal.withShared (Signal.polling 0 (pure ())) (\_ -> note book "body"))
      `shouldReturn` FaultedWith "polling: a period is more than zero seconds, not 0.0"
    notes book `shouldReturn` []
 where
  closed = FaultedWith "withShared: the shared signal was used outside its behaviour" :: Ending ()
