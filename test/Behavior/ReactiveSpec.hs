-- |
-- The reactive operators, each by itself, on watched conditions. Their promises in common
-- are in "Behavior.OperatorsSpec" and "Behavior.OutcomeSpec"; 'Signal.monitor' has a spec
-- of its own.
module Behavior.ReactiveSpec (spec) where

import Control.Concurrent (yield)
import Control.Concurrent.Async (wait)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (replicateM_, unless, void)
import Data.Foldable (for_)
import Data.IORef
import Data.List (group)
import Test.Hspec hiding (after, around, before)
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck (ioProperty, (===))

import Behavior (Behavior, failWith)
import Behavior.Internal.Seam.Runtime (atomically, now, sleep)
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Sim (Outcome (Returned), Run (finished, outcome), simulate)
import Behavior.Time (timeout)
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "Laws" laws
  describe "rSelect" selecting
  describe "switch" switching
  describe "teleoReactive" rules
  describe "read" readingOnce
  describe "waitUntil" (waiting Signal.waitUntil)
  describe "waitUntilJust" $ do
    waiting (Signal.waitUntilJust . fmap (\holds -> if holds then Just () else Nothing))
    it "returns the value, which need not have an equality" $ do
      found <- newTVarIO Nothing
      withThread (Signal.waitUntilJust (watchedVar found)) $ \caller -> do
        stillRunning caller
        atomically (writeTVar found (Just (+ (1 :: Int))))
        (($ 1) <$> wait caller) `shouldReturn` 2
  describe "whileHolding" holding

laws :: Spec
laws = do
  prop "rSelect (pure True) l r is l" $ \l r ->
    (\n -> Signal.rSelect (pure True) (play n l) (play n r)) `sameAs` (`play` l)
  prop "rSelect (pure False) l r is r" $ \l r ->
    (\n -> Signal.rSelect (pure False) (play n l) (play n r)) `sameAs` (`play` r)
  prop "rSelect c l r is switch c (\\h -> if h then l else r)" $ \c l r ->
    (\n -> Signal.rSelect (pure c) (play n l) (play n r))
      `sameAs` (\n -> Signal.switch (pure c) (\h -> play n (if h then l else r)))
  prop "monitor (pure False) r t is t" $ \r t ->
    (\n -> Signal.monitor (pure False) (void (play n r)) (play n t)) `sameAs` (`play` t)
  prop "switch (pure k) b is b k" $ \k ones others ->
    let scripts key = if key == 'k' then ones else others
     in (\n -> Signal.switch (pure k) (play n . scripts)) `sameAs` (`play` scripts k)
  prop "teleoReactive runs the first behaviour whose condition holds" $ \before b after ->
    let rulesOf n =
          [(pure False, play n a) | a <- before]
            ++ (pure True, play n b) : [(pure h, play n a) | (h, a) <- after]
     in (Signal.teleoReactive . rulesOf) `sameAs` (`play` b)
  prop "whileHolding (pure True) b is b" $ \b ->
    (\n -> Signal.whileHolding (pure True) (play n b)) `sameAs` (`play` b)
  prop "whileHolding (pure False) b fails, and b does not run" $ \b ->
    (\n -> Signal.whileHolding (pure False) (play n b))
      `sameAs` const (failWith "the condition does not hold")
  it "waitUntil (pure True) is pure ()" $
    Signal.waitUntil (pure True) `shouldReturn` ()

selecting :: Spec
selecting = do
  -- Each branch sets the condition to the next value of the script that is not its own,
  -- and then waits to be stopped. Without such a value it ends.
  prop "runs the branch that the condition selects, change after change" $ \first script ->
    ioProperty $ do
      entries <- newLog
      condition <- newTVarIO first
      rest <- newTVarIO script
      let branch own = do
            note entries own
            over <- atomically $ do
              (same, others) <- span (== own) <$> readTVar rest
              writeTVar rest (drop 1 others)
              case others of
                [] -> True <$ pure same
                next : _ -> False <$ writeTVar condition next
            unless over hang
      Signal.rSelect (watchedVar condition) (branch True) (branch False)
      ([key | key : _ <- group (first : script)] ===) <$> notes entries

  it "never runs both branches at the same time, however the condition flickers" $ do
    occupancy <- newOccupancyCounter
    condition <- newTVarIO True
    runs <- newTVarIO Nothing
    over <- newGate
    let branch own =
          inside occupancy $
            (atomically (writeTVar runs (Just own)) >> pass over)
              `onException` replicateM_ 3 yield
    withThread (Signal.rSelect (watchedVar condition) (branch True) (branch False)) $ \caller -> do
      for_ [1 .. 500 :: Int] $ \n -> do
        atomically (modifyTVar' condition not)
        -- Two times of three, wait until the selected branch runs.
        unless (n `mod` 3 == 0) . atomically $
          (==) <$> readTVar runs <*> (Just <$> readTVar condition) >>= check
      open over
      awaitEnd caller `shouldReturn` Gave ()
    mostInside occupancy `shouldReturn` 1

  it "runs an instant branch exactly once, however the condition flickers" $ do
    occupancy <- newOccupancyCounter
    condition <- newTVarIO True
    ran <- newTVarIO (0 :: Int)
    -- Masked, it runs completely or not at all: a run that is counted has completed, and
    -- must be the only one.
    let branch = mask_ (inside occupancy (atomically (modifyTVar' ran (+ 1))))
        flicker = replicateM_ 20 (atomically (modifyTVar' condition not) >> yield)
    replicateM_ 500 . withThread flicker $ \flickering -> do
      Signal.rSelect (watchedVar condition) branch branch
      awaitEnd flickering `shouldReturn` Gave ()
    readTVarIO ran `shouldReturn` 500
    mostInside occupancy `shouldReturn` 1

  it "runs the branch that the condition selects when the old one has ended, not when it changed" $ do
    entries <- newLog
    condition <- newTVarIO 'a'
    entered <- newGate
    cleaning <- newGate
    release <- newGate
    let branch 'a' = do
          note entries "a"
          (open entered >> hang) `onException` do
            open cleaning
            pass release
            note entries "a is over"
        branch key = note entries [key]
    withThread (Signal.switch (watchedVar condition) branch) $ \caller -> do
      pass entered
      atomically (writeTVar condition 'b')
      pass cleaning
      atomically (writeTVar condition 'c')
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes entries `shouldReturn` ["a", "a is over", "c"]

  it "restarts the same branch when the condition has changed back meanwhile" $ do
    entries <- newLog
    condition <- newTVarIO True
    entered <- newGate
    let left =
          notes entries >>= \before ->
            if null before
              then do
                note entries "left"
                -- The cleanup itself changes the condition back.
                (open entered >> hang) `onException` atomically (writeTVar condition True)
              else note entries "left again"
        right = note entries "right"
    withThread (Signal.rSelect (watchedVar condition) left right) $ \caller -> do
      pass entered
      atomically (writeTVar condition False)
      awaitEnd caller `shouldReturn` Gave ()
    notes entries `shouldReturn` ["left", "left again"]

  for_ [SensorFailure, SensorFault, NoValue] $ \newState ->
    it ("starts nothing when the condition's state, read again, is " ++ show newState) $ do
      entries <- newLog
      condition <- newTestCondition True
      entered <- newGate
      let left = note entries "left" >> (open entered >> hang) `onException` set condition newState
          right = note entries "right"
      withThread (Signal.rSelect (watched condition) left right) $ \caller -> do
        pass entered
        set condition (Value False)
        awaitEnd caller `shouldReturn` expected newState
      notes entries `shouldReturn` ["left"]

  it "receives its cancellation while a branch is uninterruptible, and then stops its sensor" $ do
    -- The stop of the branch is requested at 1.2, and the branch is uninterruptible until 5.
    -- The caller is cancelled at 3: that interrupts its stop request, which it has to repeat.
    times <- newIORef []
    let test = now >>= \t -> (t < 1) <$ modifyIORef times (t :)
        slow = uninterruptibleMask_ (sleep 5) >> sleep 100
    run <- simulate (timeout 3 (Signal.rSelect (Signal.polling 0.4 test) slow (pure ())))
    finished run `shouldBe` 5
    readIORef times >>= (`shouldSatisfy` (<= 3)) . maximum
 where
  expected newState = case newState of
    SensorFailure -> FailedWith "FailedBecause \"the sensor\""
    SensorFault -> FaultedWith (show (Fault "the sensor"))
    _ -> FailedWith "FailedBecause \"the signal has no value any more\""

-- | A type with nothing but equality.
data Mode = Search | Fetch | Rest
  deriving (Eq)

switching :: Spec
switching =
  it "has a branch for each value of any type with equality" $ do
    entries <- newLog
    mode <- newTVarIO Search
    let become next = atomically (writeTVar mode next)
        behave Search = note entries "search" >> become Fetch >> hang
        behave Fetch = note entries "fetch" >> become Rest >> hang
        behave Rest = note entries "rest"
    Signal.switch (watchedVar mode) behave
    notes entries `shouldReturn` ["search", "fetch", "rest"]

rules :: Spec
rules = do
  it "interrupts a rule for an earlier one, and not for a later one" $ do
    entries <- newLog
    [first, second, third] <- traverse newTVarIO [False, True, False]
    let turn variable = atomically . writeTVar variable
        one = note entries "first"
        two = do
          note entries "second"
          turn third True
          -- If it were interrupted for the third, it would be stopped before this entry.
          mask_ (note entries "second goes on")
          turn first True
          hang
        three = note entries "third"
    Signal.teleoReactive (zip (map watchedVar [first, second, third]) [one, two, three])
    notes entries `shouldReturn` ["second", "second goes on", "first"]

  it "starts the next rule that holds when the running one no longer does" $ do
    entries <- newLog
    first <- newTVarIO True
    let one = note entries "first" >> atomically (writeTVar first False) >> hang
    Signal.teleoReactive
      [(watchedVar first, one), (pure False, note entries "second"), (pure True, note entries "third")]
    notes entries `shouldReturn` ["first", "third"]

  it "waits while no rule holds, at first and later" $ do
    entries <- newLog
    hungry <- newTVarIO False
    tired <- newTVarIO False
    entered <- newGate
    let turn variable = atomically . writeTVar variable
        eat = note entries "eat" >> open entered >> hang
        sleeps = note entries "sleep"
    withThread (Signal.teleoReactive [(watchedVar tired, sleeps), (watchedVar hungry, eat)]) $ \caller -> do
      stillRunning caller
      turn hungry True
      pass entered
      turn hungry False
      stillRunning caller
      note entries "now"
      turn tired True
      awaitEnd caller `shouldReturn` Gave ()
    notes entries `shouldReturn` ["eat", "now", "sleep"]

  it "fails when a condition fails, also while no rule holds" $ do
    condition <- newTestCondition False
    withThread (Signal.teleoReactive [(watched condition, pure ()), (pure False, pure ())]) $ \caller -> do
      stillRunning caller
      set condition SensorFailure
      awaitEnd caller `shouldReturn` FailedWith "FailedBecause \"the sensor\""

waiting :: (Signal Bool -> Behavior ()) -> Spec
waiting waitUntil = do
  it "returns when the condition holds, and not before" $ do
    condition <- newTestCondition False
    withThread (waitUntil (watched condition)) $ \caller -> do
      stillRunning caller
      set condition (Value True)
      awaitEnd caller `shouldReturn` Gave ()

  for_ [SensorFailure, SensorFault, NoValue] $ \newState ->
    it ("ends, instead of waiting on, when the condition's state is " ++ show newState) $ do
      condition <- newTestCondition False
      withThread (waitUntil (watched condition)) $ \caller -> do
        stillRunning caller
        set condition newState
        awaitEnd caller >>= (`shouldSatisfy` (/= Gave ()))

  it "can be cancelled" $ do
    condition <- newTestCondition False
    cancelling (waitUntil (watched condition)) (pure ())
      `shouldReturn` CancelledBy (show (Cancel "the caller"))

readingOnce :: Spec
readingOnce = do
  it "gives the value that there is, by one reading of a sensor" $ do
    counted <- newSensor pure
    run <- simulate (Signal.read ((,) <$> Signal.polling 60 (sensor counted) <*> pure 'a'))
    (finished run, [value | Returned value <- [outcome run]]) `shouldBe` (0, [(1, 'a')])
    readings counted `shouldReturn` 1

  it "waits for the first value" $ do
    found <- newTVarIO Nothing
    withThread (Signal.read (Signal.watching (readTVar found >>= maybe retry pure))) $ \caller -> do
      stillRunning caller
      atomically (writeTVar found (Just 'a'))
      awaitEnd caller `shouldReturn` Gave 'a'

  it "fails and faults as the signal does" $
    for_ [throwIO (Failure "reading"), throwIO (Fault "reading")] $ \act -> do
      end <- ending (Signal.read (Signal.polling 60 act) :: IO ())
      ending act `shouldReturn` end

holding :: Spec
holding =
  it "fails, once its branch has ended, when the condition stops holding" $ do
    entries <- newLog
    condition <- newTestCondition True
    let grip = note entries "grip" >> (set condition (Value False) >> hang) `onException` note entries "let go"
    end <- ending (Signal.whileHolding (watched condition) grip `onException` note entries "failed")
    end `shouldBe` (FailedWith "FailedBecause \"the condition does not hold\"" :: Ending ())
    notes entries `shouldReturn` ["grip", "let go", "failed"]
