{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- 'Signal.polling': when a sensor is read, by which thread, and which readings decide. The
-- readings drive these tests: each counts, waits at a gate or reads the clock. Readings that
-- go wrong have a spec of their own.
module Behavior.PollingSpec (spec) where

import Control.Concurrent (myThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (forever, replicateM_, unless, void, when)
import Data.Foldable (for_)
import Data.List (group, nub)
import Test.Hspec hiding (after, before)

import Behavior (Behavior, Seconds, sleep, (|||))
import Behavior.Internal.Seam.Runtime (Label (..), atomically, now)
import qualified Behavior.Signal as Signal
import Behavior.Sim (SimOptions (scheduled, timerSlip), Schedule (Seeded), defaultSimOptions, simulate, simulateWith)
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "polling, when it reads:" slots
  describe "polling, which readings decide:" deciding
  describe "polling, around a recovery:" recovering

-- | The moments at which readings began and ended, the first reading first.
type Times = Log (Seconds, Seconds)

-- | A sensor that adds to a log when it was read.
timed :: Times -> (Int -> Behavior a) -> IO (Sensor a)
timed times act = newSensor $ \n -> do
  began <- now
  value <- act n
  ended <- now
  value <$ note times (began, ended)

-- | No reading began less than a period after the one before.
--
-- A reading reads the clock a little after it has begun; so its beginning is compared with
-- the end of the last reading but one.
apart :: Seconds -> [(Seconds, Seconds)] -> Expectation
apart period times =
  [gap | ((_, ended), (began, _)) <- zip times (drop 2 times), let gap = began - ended, gap < period]
    `shouldBe` []

-- | There were no more readings than there were periods.
noMoreThan :: Seconds -> Seconds -> [(Seconds, Seconds)] -> Expectation
noMoreThan period since times =
  [n | (n, (began, _)) <- zip [0 ..] times, began - since < fromIntegral (n :: Int) * period]
    `shouldBe` []

slots :: Spec
slots = do
  it "readings start at least a period apart" $ do
    times <- newLog
    level <- timed times (pure . (> 50))
    since <- now
    Signal.waitUntil (Signal.polling 0.001 (sensor level))
    notes times >>= \known -> apart 0.001 known >> noMoreThan 0.001 since known

  it "a reading that is late does not delay the slots after it" $
    for_ [1 .. 5] $ \seed -> do
      entries <- newLog
      let late = Signal.polling 0.01 (False <$ note entries ())
      _ <- simulateWith defaultSimOptions {timerSlip = 0.004, scheduled = Seeded seed}
        (Signal.monitor late (pure ()) (sleep 5 ||| forever (sleep 0.0031)))
      notes entries >>= (`shouldSatisfy` (`elem` [500, 501])) . length

  it "after a slow reading the slots that it missed are skipped, and not made up for" $ do
    times <- newLog
    level <- timed times $ \n -> do
      began <- now
      when (n == 3) $ eventually ((>= began + 0.01) <$> now)
      pure (n > 20)
    Signal.waitUntil (Signal.polling 0.001 (sensor level))
    known <- notes times
    apart 0.001 known
    noMoreThan 0.001 (snd (known !! 2)) (drop 3 known)

  it "after a slow reading the next one begins in a slot, and not in between" $ do
    moments <- newLog
    _ <- simulate . Signal.waitUntil . Signal.polling 2 $ do
      now >>= note moments
      n <- length <$> notes moments
      when (n == 2) (sleep 5)
      pure (n == 4)
    notes moments `shouldReturn` [0, 2, 8, 10]

  it "a reading that was stopped has used up its slot" $ do
    moments <- newLog
    alarm <- newTVarIO False
    let reading = now >>= note moments >> sleep 3
        signal = const <$> watchedVar alarm <*> Signal.polling 10 reading
        change = sleep 11 >> atomically (writeTVar alarm True) >> hang
    _ <- simulate (Signal.monitor signal (atomically (writeTVar alarm False)) (sleep 15) ||| change)
    notes moments `shouldReturn` [0, 10, 20, 30]

  it "readings start a period apart also when a branch is switched each time" $ do
    times <- newLog
    level <- timed times (\n -> pure (if n > 50 then -1 else n))
    let branch n = unless (n < 0) hang
    since <- now
    Signal.switch (Signal.polling 0.001 (sensor level)) branch
    notes times >>= \known -> apart 0.001 known >> noMoreThan 0.001 since known

  it "readings start a period apart when recovery after recovery takes no time" $ do
    times <- newLog
    level <- timed times (pure . (<= 50))
    since <- now
    Signal.monitor (Signal.polling 0.001 (sensor level)) (pure ()) (pure ())
    notes times >>= \known -> apart 0.001 known >> noMoreThan 0.001 since known

  it "one reading runs at a time" $ do
    occupancy <- newOccupancyCounter
    level <- newSensor (inside occupancy . pure)
    Signal.switch (sensing level) (\n -> when (n < 50) hang)
    mostInside occupancy `shouldReturn` 1

  for_ [(0, "0.0"), (-1, "-1.0"), (0 / 0, "NaN"), (5e-324, "5.0e-324"), (0.0000009, "0.0000009")] $
    \(period, shown) -> do
      it ("a period of " ++ shown ++ " is refused, and nothing starts") $ do
        entries <- newLog
        let signal = Signal.polling period (True <$ note entries "reading")
        ending (Signal.rSelect signal (note entries "left") (note entries "right"))
          `shouldReturn` FaultedWith ("polling: a period is at least 0.000001 seconds, not " ++ shown)
        notes entries `shouldReturn` []

deciding :: Spec
deciding = do
  it "the first reading decides, however long the period" $
    -- With no second reading to wait for, an operator that missed it would wait for ever.
    replicateM_ 500 $
      Signal.rSelect (Signal.polling (1 / 0) (pure True)) (pure "l") (pure "r")
        `shouldReturn` "l"

  it "nothing starts before the first reading has ended" $ do
    entries <- newLog
    entered <- newGate
    release <- newGate
    level <- newSensor $ \_ -> do
      open entered
      pass release
      note entries "read"
      pure True
    withThread (Signal.rSelect (sensing level) (note entries "left") (note entries "right")) $ \caller -> do
      pass entered
      stillRunning caller
      open release
      awaitEnd caller `shouldReturn` Gave ()
    -- (It may be read again before that starts.)
    nub <$> notes entries `shouldReturn` ["read", "left"]

  it "after a branch has ended a reading is awaited that began after that" $ do
    entries <- newLog
    mode <- newTVarIO 'a'
    started <- newGate
    hanging <- newGate
    release <- newGate
    -- The readings after the first branch has started: the first of them hangs, and its
    -- value is from before that branch was stopped.
    later <- newTVarIO (0 :: Int)
    level <- newSensor $ \_ -> do
      isStarted <- opened started
      if not isStarted
        then pure "first"
        else do
          n <- atomically (modifyTVar' later (+ 1) >> readTVar later)
          when (n == 1) (open hanging >> pass release)
          pure (if n == 1 then "begun before" else "begun after")
    let branch ('a', _) = open started >> hang `onException` note entries "a is over"
        branch (key, seen) = note entries (key : ": " ++ seen)
    withThread (Signal.switch ((,) <$> watchedVar mode <*> sensing level) branch) $ \caller -> do
      pass hanging
      atomically (writeTVar mode 'b')
      eventually ((== ["a is over"]) <$> notes entries)
      stillRunning caller
      note entries "the reading ends"
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes entries `shouldReturn` ["a is over", "the reading ends", "b: begun after"]

  it "a change that is undone when the old branch has ended restarts that branch" $ do
    entries <- newLog
    closed <- newTVarIO True
    level <- newSensor (const (readTVarIO closed))
    let left =
          notes entries >>= \earlier -> do
            note entries "left"
            when (null earlier) $
              (atomically (writeTVar closed False) >> hang)
                `onException` atomically (writeTVar closed True)
    Signal.rSelect (sensing level) left (note entries "right")
    notes entries `shouldReturn` ["left", "left"]

  it "with several sources, a change of one has effect at once, though another is read only once" $ do
    alarm <- newTVarIO False
    raised <- newGate
    recovered <- newGate
    let signal = (||) <$> watchedVar alarm <*> Signal.polling (1 / 0) (pure False)
    withThread (Signal.monitor signal (open recovered) (open raised >> hang)) $ \_ -> do
      pass raised
      atomically (writeTVar alarm True)
      pass recovered

  for_ [("unmasked", id), ("masked", mask_), ("uninterruptible", uninterruptibleMask_)] $
    \(state, masked) ->
      it ("readings run unmasked for a caller that is " ++ state) $ do
        level <- newSensor (const getMaskingState)
        masked (Signal.switch (sensing level) pure) `shouldReturn` Unmasked

  it "all readings run in one thread, with a label" $ do
    events <- newLog
    threads <- newLog
    -- (When it is over is seen a little later: until then there may be other readings.)
    level <- newSensor $ \n -> (n > 5) <$ when (n <= 6) (myThreadId >>= note threads)
    watchingThreads (note events) (Signal.waitUntil (sensing level))
    notes events
      `shouldReturn` [f (Label "waitUntil" "polling") | f <- [Started, Ended]]
    map length . group <$> notes threads `shouldReturn` [6]

-- | A monitor on an alarm, which alone decides, and a polled sensor. Once the gate is open
-- the task runs and a reading is in flight. From then on each reading does what the given
-- function gives for its number from 1.
data Scene = Scene
  { history :: Log String
  , trigger :: TVar Bool
  , readingInFlight :: Gate
  , monitoring :: Behavior ()
  , monitoringBeside :: Signal.Signal () -> Behavior ()
  -- ^ With another sensor, to the left of that one.
  }

scene :: (Gate -> Int -> Behavior ()) -> IO Scene
scene act = do
  entries <- newLog
  variable <- newTVarIO False
  started <- newGate
  entered <- newGate
  later <- newTVarIO 0
  level <- newSensor $ \_ -> do
    isStarted <- opened started
    when isStarted $ atomically (modifyTVar' later (+ 1) >> readTVar later) >>= act entered
  let task = do
        again <- opened started
        note entries "task"
        unless again (open started >> hang)
      recovery = do
        atomically (writeTVar variable False)
        note entries "recovery"
      beside other = Signal.monitor ((\is _ _ -> is) <$> watchedVar variable <*> other <*> sensing level) recovery task
  pure
    Scene
      { history = entries
      , trigger = variable
      , readingInFlight = entered
      , monitoring = beside (pure ())
      , monitoringBeside = beside
      }

-- | Raises the alarm while a reading is in flight.
raise :: Scene -> IO ()
raise s = pass (readingInFlight s) >> atomically (writeTVar (trigger s) True)

recovering :: Spec
recovering = do
  it "no reading begins while the recovery runs" $ do
    resting <- newGate
    low <- newTVarIO True
    level <- newSensor (const (readTVarIO low))
    let recovery = do
          -- The thread that polls has ended.
          pass resting
          earlier <- readings level
          aWhile 0.001
          readings level `shouldReturn` earlier
          atomically (writeTVar low False)
        watch event = when (event == Ended (Label "monitor" "polling")) (open resting)
    watchingThreads watch (Signal.monitor (sensing level) recovery (pure "task"))
      `shouldReturn` "task"

  it "what decides after the recovery is a reading that began after it" $ do
    recoveries <- newTVarIO (0 :: Int)
    low <- newTVarIO True
    level <- newSensor (const (readTVarIO low))
    Signal.monitor (sensing level) `flip` pure () $ do
      atomically (modifyTVar' recoveries (+ 1))
      atomically (writeTVar low False)
    readTVarIO recoveries `shouldReturn` 1

  it "the recovery does not wait for a slow reading, but the task after it does" $ do
    release <- newGate
    s <- scene $ \entered n -> when (n == 1) . uninterruptibleMask_ $ open entered >> pass release
    withThread (monitoring s) $ \caller -> do
      raise s
      eventually ((== ["task", "recovery"]) <$> notes (history s))
      stillRunning caller
      note (history s) "the reading ends"
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes (history s) `shouldReturn` ["task", "recovery", "the reading ends", "task"]

  it "after a recovery the task begins only when a slow reading has ended" $ do
    begun <- newLog
    alarm <- newTVarIO False
    level <- newSensor $ \n -> when (n == 2) (uninterruptibleMask_ (sleep 5))
    let signal = const <$> watchedVar alarm <*> Signal.polling 1 (sensor level)
        task = now >>= note begun >> length <$> notes begun >>= \n -> unless (n == 2) hang
        raised = sleep 2 >> atomically (writeTVar alarm True) >> hang
    _ <- simulate (Signal.monitor signal (atomically (writeTVar alarm False)) task ||| raised)
    notes begun `shouldReturn` [0, 6]

  it "a recovery that comes before any task does not wait for a slow reading either" $ do
    entries <- newLog
    low <- newTVarIO Nothing
    entered <- newGate
    release <- newGate
    level <- newSensor $ \n ->
      when (n == 2) . uninterruptibleMask_ $ open entered >> pass release
    let signal = const <$> Signal.watching (readTVar low >>= maybe retry pure) <*> sensing level
        recovery = note entries "recovery" >> atomically (writeTVar low (Just False))
    withThread (Signal.monitor signal recovery (note entries "task")) $ \caller -> do
      pass entered
      atomically (writeTVar low (Just True))
      eventually ((== ["recovery"]) <$> notes entries)
      stillRunning caller
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes entries `shouldReturn` ["recovery", "task"]

  it "the stops of task and reading are requested at once: the reading stops while the task is uninterruptible" $ do
    alarm <- newTVarIO False
    started <- newGate
    entered <- newGate
    received <- newGate
    release <- newGate
    level <- newSensor $ \_ -> do
      isStarted <- opened started
      over <- opened received
      when (isStarted && not over) $ (open entered >> hang) `onException` open received
    let task = do
          again <- opened started
          unless again $ uninterruptibleMask_ (open started >> pass release)
        recovery = atomically (writeTVar alarm False)
    withThread (Signal.monitor (const <$> watchedVar alarm <*> sensing level) recovery task) $ \caller -> do
      pass entered
      atomically (writeTVar alarm True)
      pass received
      open release
      awaitEnd caller `shouldReturn` Gave ()

  it "a reading that catches its stop request and returns does not prevent the monitor from continuing" $ do
    s <- scene $ \entered n ->
      when (n == 1) $ (open entered >> hang) `catch` \(_ :: SomeAsyncException) -> pure ()
    withThread (monitoring s) $ \caller -> do
      raise s
      awaitEnd caller `shouldReturn` Gave ()
    notes (history s) `shouldReturn` ["task", "recovery", "task"]

  for_ [Failing, Faulting] $ \how ->
    it ("a reading that is " ++ show how ++ " while it stops does not prevent the recovery") $ do
      s <- scene $ \entered n -> when (n == 1) . void $ onStop how "reading" (open entered >> hang)
      withThread (monitoring s) $ \caller -> do
        raise s
        end <- awaitEnd caller
        ran <- notes (history s)
        (end, ran) `shouldBe` case how of
          Faulting -> (FaultedWith (show (Fault "reading")), ["task", "recovery"])
          _ -> (Gave (), ["task", "recovery", "task"])

  it "the fault of any of several readings that stop for a recovery is thrown after it" $ do
    s <- scene $ \entered n -> when (n == 1) ((open entered >> hang) `onException` throwIO (Fault "reading"))
    end <- withThread (monitoringBeside s (Signal.polling 3600 (pure ()))) $ \caller -> do
      raise s
      awaitEnd caller
    end `shouldBe` FaultedWith (show (Fault "reading"))
    notes (history s) `shouldReturn` ["task", "recovery"]
