-- |
-- 'Signal.polling' and 'Signal.staleAfter': when a sensor is read, by whom, and what
-- becomes of a reading that goes wrong. The readings drive these tests: each counts,
-- waits at a gate or asks the clock.
module Behavior.PollingSpec (spec) where

import Control.Concurrent (myThreadId)
import Control.Concurrent.Async (asyncThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (replicateM_, unless, void, when)
import Data.Foldable (for_)
import Test.Hspec hiding (after, before)

import Behavior (Behavior, Seconds, failWith)
import Behavior.Internal.Runtime (Event (..), Label (..), atomically, now, reportingTo)
import qualified Behavior.Signal as Signal
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "polling, when it reads:" slots
  describe "polling, what counts:" counting
  describe "polling, a reading that" goingWrong
  describe "polling, around a recovery:" recovering
  describe "staleAfter" stale

-- | The moments at which readings began and ended, the first reading first.
type Times = Notebook (Seconds, Seconds)

-- | A sensor that notes when it was read.
timed :: Times -> (Int -> Behavior a) -> IO (Sensor a)
timed times act = newSensor $ \n -> do
  began <- now
  value <- act n
  ended <- now
  value <$ note times (began, ended)

-- | No reading began less than a period after the one before.
--
-- The clock shows a reading's own idea of when it began, which is a little after it
-- did: so what is compared is the end of the last but one.
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
    times <- newNotebook
    level <- timed times (pure . (> 50))
    since <- now
    Signal.waitUntil (Signal.polling 0.001 (sensor level))
    notes times >>= \all' -> apart 0.001 all' >> noMoreThan 0.001 since all'

  it "a slow reading skips the slots that it missed, and is not made up for" $ do
    times <- newNotebook
    level <- timed times $ \n -> do
      began <- now
      when (n == 3) $ eventually ((>= began + 0.01) <$> now)
      pure (n > 20)
    Signal.waitUntil (Signal.polling 0.001 (sensor level))
    all' <- notes times
    apart 0.001 all'
    noMoreThan 0.001 (snd (all' !! 2)) (drop 3 all')

  it "readings start a period apart also when a branch is switched each time" $ do
    times <- newNotebook
    level <- timed times (\n -> pure (if n > 50 then -1 else n))
    let branch n = unless (n < 0) hang
    since <- now
    Signal.switch (Signal.polling 0.001 (sensor level)) branch
    notes times >>= \all' -> apart 0.001 all' >> noMoreThan 0.001 since all'

  it "readings start a period apart when recovery after recovery takes no time" $ do
    times <- newNotebook
    level <- timed times (pure . (<= 50))
    since <- now
    Signal.monitor (Signal.polling 0.001 (sensor level)) (pure ()) (pure ())
    notes times >>= \all' -> apart 0.001 all' >> noMoreThan 0.001 since all'

  it "one reading runs at a time" $ do
    room <- newRoom
    level <- newSensor (inside room . pure)
    Signal.switch (sensing level) (\n -> when (n < 50) hang)
    mostInside room `shouldReturn` 1

  for_ [(0, "0.0"), (-1, "-1.0"), (0 / 0, "NaN")] $ \(period, shown) -> do
    it ("a period of " ++ shown ++ " is refused, and nothing starts") $ do
      book <- newNotebook
      let signal = Signal.polling period (True <$ note book "reading")
      ending (Signal.rSelect signal (note book "left") (note book "right"))
        `shouldReturn` FaultedWith ("polling: a period is more than zero seconds, not " ++ shown)
      notes book `shouldReturn` []

counting :: Spec
counting = do
  it "the first reading decides, however long the period" $
    -- With no second reading to wait for, an operator that missed it would wait for ever.
    replicateM_ 500 $
      Signal.rSelect (Signal.polling (1 / 0) (pure True)) (pure "l") (pure "r")
        `shouldReturn` "l"

  it "nothing starts before the first reading has ended" $ do
    book <- newNotebook
    entered <- newGate
    release <- newGate
    level <- newSensor $ \_ -> do
      open entered
      pass release
      note book "read"
      pure True
    launching (Signal.rSelect (sensing level) (note book "left") (note book "right")) $ \caller -> do
      pass entered
      stillRunning caller
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes book `shouldReturn` ["read", "left"]

  it "after a branch has ended a reading is awaited that began after that" $ do
    book <- newNotebook
    mode <- newTVarIO 'a'
    started <- newGate
    hanging <- newGate
    release <- newGate
    -- The readings after the first branch has started: the first of them hangs, and
    -- sees what was there before that branch was stopped.
    later <- newTVarIO (0 :: Int)
    level <- newSensor $ \_ -> do
      isStarted <- opened started
      if not isStarted
        then pure "first"
        else do
          n <- atomically (modifyTVar' later (+ 1) >> readTVar later)
          when (n == 1) (open hanging >> pass release)
          pure (if n == 1 then "begun before" else "begun after")
    let branch ('a', _) = open started >> hang `onException` note book "a is over"
        branch (key, seen) = note book (key : ": " ++ seen)
    launching (Signal.switch ((,) <$> dialled mode <*> sensing level) branch) $ \caller -> do
      pass hanging
      atomically (writeTVar mode 'b')
      eventually ((== ["a is over"]) <$> notes book)
      stillRunning caller
      note book "the reading ends"
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes book `shouldReturn` ["a is over", "the reading ends", "b: begun after"]

  it "a change that is over when the old branch has ended starts that branch anew" $ do
    book <- newNotebook
    closed <- newTVarIO True
    level <- newSensor (const (readTVarIO closed))
    let left =
          notes book >>= \earlier -> do
            note book "left"
            when (null earlier) $
              (atomically (writeTVar closed False) >> hang)
                `onException` atomically (writeTVar closed True)
    Signal.rSelect (sensing level) left (note book "right")
    notes book `shouldReturn` ["left", "left"]

  it "with several sources, a change of one counts at once, though another is read but once" $ do
    alarm <- newTVarIO False
    raised <- newGate
    recovered <- newGate
    let signal = (||) <$> dialled alarm <*> Signal.polling (1 / 0) (pure False)
    launching (Signal.monitor signal (open recovered) (open raised >> hang)) $ \_ -> do
      pass raised
      atomically (writeTVar alarm True)
      pass recovered

  for_ [("unmasked", id), ("masked", mask_), ("uninterruptible", uninterruptibleMask_)] $
    \(state, masked) ->
      it ("readings run unmasked for a caller that is " ++ state) $ do
        level <- newSensor (const getMaskingState)
        masked (Signal.switch (sensing level) pure) `shouldReturn` Unmasked

  it "readings run in one thread, with a label" $ do
    events <- newNotebook
    threads <- newNotebook
    level <- newSensor $ \n -> (n > 5) <$ (myThreadId >>= note threads)
    reportingTo (note events) (Signal.waitUntil (sensing level))
    notes events
      `shouldReturn` [f (Label "waitUntil" "polling") | f <- [Started, Ended]]
    notes threads >>= (`shouldSatisfy` \(one : others) -> all (== one) others)

goingWrong :: Spec
goingWrong = do
  for_ operators $ \op ->
    for_ faulty $ \(manner, act, end) ->
      it (unwords [manner, "ends", show op, "after its branch"]) $ do
        book <- newNotebook
        entered <- newGate
        level <- newSensor $ \_ -> opened entered >>= \isEntered -> if isEntered then act else pure True
        let main =
              (open entered >> hang) `onException` do
                note book "main is over"
            other = note book "other" >> pure "other"
        ending (running op (sensing level) main other `onException` note book "over")
          `shouldReturn` end
        notes book `shouldReturn` ["main is over", "over"]

  for_ faulty $ \(manner, act, end) ->
    it (manner ++ " the first time starts nothing") $ do
      book <- newNotebook
      ending (Signal.rSelect (Signal.polling 0.001 act) (note book "l") (note book "r"))
        >>= (`shouldBe` fmap' end)
      notes book `shouldReturn` []

  it "swallows the request to stop does not keep the operator from ending" $ do
    entered <- newGate
    level <- newSensor $ \_ -> do
      open entered
      hang `catch` \e -> pure (null (show (e :: SomeAsyncException)))
    cancelling (Signal.waitUntil (sensing level)) (pass entered)
      `shouldReturn` CancelledBy (show (Cancel "the caller"))
    readings level `shouldReturn` 1

  for_ [minBound .. maxBound] $ \how ->
    it (unwords ["is stopped because the branch has completed, and then", manners how]) $ do
      entered <- newGate
      started <- newGate
      level <- newSensor $ \_ -> do
        isStarted <- opened started
        when isStarted . void $ onStop how "reading" (open entered >> hang)
        pure True
      end <- ending (Signal.rSelect (sensing level) (open started >> pass entered) (pure ()))
      end `shouldBe` case how of
        Faulting -> FaultedWith (show (Fault "reading"))
        _ -> Gave ()

  for_ [minBound .. maxBound] $ \how ->
    it (unwords ["is stopped because the caller is cancelled, and then", manners how]) $ do
      entered <- newGate
      level <- newSensor $ \_ -> True <$ onStop how "reading" (open entered >> hang)
      end <- cancelling (leavingNothing (Signal.waitUntil (sensing level))) (pass entered)
      end `shouldBe` case how of
        Faulting -> CancelledWithFault (show (Cancel "the caller")) (show (Fault "reading"))
        _ -> CancelledBy (show (Cancel "the caller"))

  it "cannot be interrupted has ended before its operator" $ do
    book <- newNotebook
    started <- newGate
    entered <- newGate
    release <- newGate
    level <- newSensor $ \_ -> do
      isStarted <- opened started
      when isStarted . uninterruptibleMask_ $ do
        open entered
        pass release
        note book "reading is over"
      pure True
    let act = do
          Signal.rSelect (sensing level) (open started >> pass entered >> note book "branch is over") (pure ())
          note book "operator is over"
    launching act $ \caller -> do
      eventually ((== ["branch is over"]) <$> notes book)
      awaitUnheard (asyncThreadId caller)
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes book `shouldReturn` ["branch is over", "reading is over", "operator is over"]

  for_ ["reading", "branch"] $ \deaf ->
    it ("has to stop hears it at once, with the branch, though the " ++ deaf ++ " is deaf") $ do
      started <- newGate
      readingEntered <- newGate
      heard <- newGate
      release <- newGate
      let being name entered
            | name == deaf = uninterruptibleMask_ (open entered >> pass release)
            | otherwise = (open entered >> hang) `onException` open heard
      level <- newSensor $ \_ -> do
        isStarted <- opened started
        when isStarted (being "reading" readingEntered)
        pure True
      let act = Signal.rSelect (sensing level) (being "branch" started) (pure ())
      launching act $ \caller -> do
        pass readingEntered
        throwing (asyncThreadId caller) (Cancel "the caller")
        -- It is the other one that hears, while the deaf one still waits.
        pass heard
        open release
        awaitEnd caller `shouldReturn` CancelledBy (show (Cancel "the caller"))
 where
  faulty =
    [ ("fails", failWith "no echo", FailedWith "FailedBecause \"no echo\"")
    , ("faults", throwIO (Fault "no echo"), FaultedWith (show (Fault "no echo")))
    ] ::
      [(String, Behavior Bool, Ending String)]
  fmap' end = case end of
    FailedWith why -> FailedWith why
    FaultedWith what -> FaultedWith what
    _ -> Gave ()
  manners how = case how of
    Cleanly -> "stops"
    Completing -> "returns all the same"
    Failing -> "fails: which nobody minds"
    Faulting -> "faults: which gets out"

-- | A monitor that has a polled sensor and an alarm, which alone decides; whose task
-- is under way, and whose sensor is just being read, once the gate is open. From then
-- on each reading does as the test says, by its number from 1.
data Scene = Scene
  { history :: Notebook String
  , trigger :: TVar Bool
  , underWay :: Gate
  , monitoring :: Behavior ()
  }

scene :: (Gate -> Int -> Behavior ()) -> IO Scene
scene act = do
  notebook <- newNotebook
  variable <- newTVarIO False
  started <- newGate
  entered <- newGate
  later <- newTVarIO 0
  level <- newSensor $ \_ -> do
    isStarted <- opened started
    when isStarted $ atomically (modifyTVar' later (+ 1) >> readTVar later) >>= act entered
  let task = do
        again <- opened started
        note notebook "task"
        unless again (open started >> hang)
      recovery = do
        atomically (writeTVar variable False)
        note notebook "recovery"
  pure
    Scene
      { history = notebook
      , trigger = variable
      , underWay = entered
      , monitoring = Signal.monitor (const <$> dialled variable <*> sensing level) recovery task
      }

-- | Raises the alarm while a reading is under way.
raise :: Scene -> IO ()
raise s = pass (underWay s) >> atomically (writeTVar (trigger s) True)

recovering :: Spec
recovering = do
  it "no reading begins while the recovery runs" $ do
    resting <- newGate
    low <- newTVarIO True
    level <- newSensor (const (readTVarIO low))
    let recovery = do
          -- From here on the poller is no more.
          pass resting
          earlier <- readings level
          aWhile 0.001
          readings level `shouldReturn` earlier
          atomically (writeTVar low False)
        watch event = when (event == Ended (Label "monitor" "polling")) (open resting)
    reportingTo watch (Signal.monitor (sensing level) recovery (pure "task"))
      `shouldReturn` "task"

  it "what decides after the recovery is a reading that began after it" $ do
    recoveries <- newTVarIO (0 :: Int)
    low <- newTVarIO True
    level <- newSensor (const (readTVarIO low))
    Signal.monitor (sensing level) `flip` pure () $ do
      atomically (modifyTVar' recoveries (+ 1))
      atomically (writeTVar low False)
    readTVarIO recoveries `shouldReturn` 1

  it "the recovery does not wait for a slow reading, but what comes after it does" $ do
    release <- newGate
    s <- scene $ \entered n -> when (n == 1) . uninterruptibleMask_ $ open entered >> pass release
    launching (monitoring s) $ \caller -> do
      raise s
      eventually ((== ["task", "recovery"]) <$> notes (history s))
      stillRunning caller
      note (history s) "the reading ends"
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes (history s) `shouldReturn` ["task", "recovery", "the reading ends", "task"]

  it "a recovery that comes before any task does not wait for a slow reading either" $ do
    book <- newNotebook
    low <- newTVarIO Nothing
    entered <- newGate
    release <- newGate
    level <- newSensor $ \n ->
      when (n == 2) . uninterruptibleMask_ $ open entered >> pass release
    let signal = const <$> Signal.watching (readTVar low >>= maybe retry pure) <*> sensing level
        recovery = note book "recovery" >> atomically (writeTVar low (Just False))
    launching (Signal.monitor signal recovery (note book "task")) $ \caller -> do
      pass entered
      atomically (writeTVar low (Just True))
      eventually ((== ["recovery"]) <$> notes book)
      stillRunning caller
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes book `shouldReturn` ["recovery", "task"]

  it "a reading that swallows the request to stop does not keep the monitor from going on" $ do
    s <- scene $ \entered n ->
      when (n == 1) $ (open entered >> hang) `catch` \e -> const (pure ()) (e :: SomeAsyncException)
    launching (monitoring s) $ \caller -> do
      raise s
      awaitEnd caller `shouldReturn` Gave ()
    notes (history s) `shouldReturn` ["task", "recovery", "task"]

  for_ [Failing, Faulting] $ \how ->
    it ("a reading that is " ++ show how ++ " while it stops, and then the recovery") $ do
      s <- scene $ \entered n -> when (n == 1) . void $ onStop how "reading" (open entered >> hang)
      launching (monitoring s) $ \caller -> do
        raise s
        end <- awaitEnd caller
        ran <- notes (history s)
        (end, ran) `shouldBe` case how of
          Faulting -> (FaultedWith (show (Fault "reading")), ["task", "recovery"])
          _ -> (Gave (), ["task", "recovery", "task"])

stale :: Spec
stale = do
  for_ operators $ \op ->
    it ("makes " ++ show op ++ " fail when a reading takes longer, after its branch has ended") $ do
      book <- newNotebook
      started <- newGate
      -- When the reading before the one that hangs was about to end.
      last' <- newTVarIO 0
      level <- newSensor $ \_ -> do
        isStarted <- opened started
        when isStarted hang
        now >>= atomically . writeTVar last'
        pure True
      let main = (open started >> hang) `onException` note book "main is over"
          other = note book "other" >> pure "other"
          signal = Signal.staleAfter 0.005 (sensing level)
      end <- ending (running op signal main other)
      over <- now
      end `shouldBe` FailedWith (tooLong "0.005")
      since <- readTVarIO last'
      over - since `shouldSatisfy` (>= 0.005)
      notes book `shouldReturn` ["main is over"]

  it "fails when there is not even a first reading" $ do
    book <- newNotebook
    let signal = Signal.staleAfter 0.001 (Signal.polling 0.001 hang)
    ending (Signal.rSelect signal (note book "left") (note book "right"))
      `shouldReturn` FailedWith (tooLong "0.001")
    notes book `shouldReturn` []

  it "stops the branch in time when the reading cannot be interrupted, and returns after it" $ do
    book <- newNotebook
    started <- newGate
    stopped <- newGate
    release <- newGate
    level <- newSensor $ \_ -> do
      isStarted <- opened started
      when isStarted . uninterruptibleMask_ $ pass release >> note book "reading is over"
      pure True
    let branch = (open started >> hang) `onException` (note book "branch is over" >> open stopped)
        act =
          Signal.rSelect (Signal.staleAfter 0.001 (sensing level)) branch branch
            `onException` note book "operator is over"
    launching act $ \caller -> do
      pass stopped
      stillRunning caller
      open release
      awaitEnd caller `shouldReturn` (FailedWith (tooLong "0.001") :: Ending ())
    notes book `shouldReturn` ["branch is over", "reading is over", "operator is over"]

  it "lets pass readings that are in time" $ do
    level <- newSensor (pure . (> 20))
    Signal.waitUntil (Signal.staleAfter 3600 (sensing level))

  it "does not count the time between readings" $
    -- The reading is instant, the next is far away, and the branch takes longer.
    Signal.rSelect (Signal.staleAfter 0.001 (Signal.polling (1 / 0) (pure True))) (aWhile 0.001) hang

  it "does not count the time of a recovery" $ do
    low <- newTVarIO True
    level <- newSensor (const (readTVarIO low))
    let recovery = aWhile 0.001 >> atomically (writeTVar low False)
    Signal.monitor (Signal.staleAfter 0.005 (Signal.polling 0.001 (sensor level))) recovery (pure ())

  it "never fails a signal that is not polled" $ do
    dial <- newDial True
    Signal.rSelect (Signal.staleAfter 0.001 (watched dial)) (aWhile 0.001) hang

  it "watches each of several sources" $ do
    let signal = (&&) <$> Signal.polling 0.001 (pure True) <*> Signal.polling 0.001 hang
    ending (Signal.waitUntil (Signal.staleAfter 0.005 signal))
      `shouldReturn` FailedWith (tooLong "0.005")

  for_ [(0, "0.0"), (-1, "-1.0"), (0 / 0, "NaN")] $ \(limit, shown) ->
    it ("refuses a limit of " ++ shown ++ ", and nothing starts") $ do
      book <- newNotebook
      let signal = Signal.staleAfter limit (Signal.polling 0.001 (True <$ note book "reading"))
      ending (Signal.rSelect signal (note book "left") (note book "right"))
        `shouldReturn` FaultedWith ("staleAfter: a period is more than zero seconds, not " ++ shown)
      notes book `shouldReturn` []
 where
  tooLong limit = "FailedBecause " ++ show ("no reading of the signal within " ++ limit ++ " s")
