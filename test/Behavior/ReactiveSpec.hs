-- |
-- The reactive operators, each by itself, on conditions that are watched. What is the
-- same for all is in "Behavior.OperatorsSpec" and "Behavior.OutcomeSpec";
-- 'Signal.monitor' has a spec of its own.
module Behavior.ReactiveSpec (spec) where

import Control.Concurrent (yield)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (replicateM_, unless, void)
import Data.Foldable (for_)
import Data.IORef
import Data.List (group)
import Test.Hspec hiding (after, around, before)
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck (ioProperty, (===))

import Behavior (failWith)
import Behavior.Internal.Runtime (atomically, now, sleep)
import qualified Behavior.Signal as Signal
import Behavior.Sim (finished, simulate)
import Behavior.Time (timeout)
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "Laws" laws
  describe "rSelect" selecting
  describe "switch" switching
  describe "teleoReactive" rules
  describe "waitUntil" waiting
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
  -- Each branch turns the condition to the next value that the script has for it, until
  -- one is another than its own: then it waits to be stopped.
  prop "runs what the condition says, change after change" $ \first script ->
    ioProperty $ do
      book <- newLog
      condition <- newTVarIO first
      rest <- newTVarIO script
      let branch own = do
            note book own
            over <- atomically $ do
              (same, others) <- span (== own) <$> readTVar rest
              writeTVar rest (drop 1 others)
              case others of
                [] -> True <$ pure same
                next : _ -> False <$ writeTVar condition next
            unless over hang
      Signal.rSelect (dialled condition) (branch True) (branch False)
      ([key | key : _ <- group (first : script)] ===) <$> notes book

  it "never runs both branches at once, however the condition flickers" $ do
    occupancy <- newOccupancyCounter
    condition <- newTVarIO True
    runs <- newTVarIO Nothing
    over <- newGate
    let branch own =
          inside occupancy $
            (atomically (writeTVar runs (Just own)) >> pass over)
              `onException` replicateM_ 3 yield
    launching (Signal.rSelect (dialled condition) (branch True) (branch False)) $ \caller -> do
      for_ [1 .. 500 :: Int] $ \n -> do
        atomically (modifyTVar' condition not)
        -- Two times of three what the condition says may come to run.
        unless (n `mod` 3 == 0) . atomically $
          (==) <$> readTVar runs <*> (Just <$> readTVar condition) >>= check
      open over
      awaitEnd caller `shouldReturn` Gave ()
    mostInside occupancy `shouldReturn` 1

  it "runs an instant branch exactly once, however the condition flickers" $ do
    occupancy <- newOccupancyCounter
    condition <- newTVarIO True
    ran <- newTVarIO (0 :: Int)
    -- Masked, it runs wholly or not at all: a run that counts has completed, and must be
    -- the only one.
    let branch = mask_ (inside occupancy (atomically (modifyTVar' ran (+ 1))))
        flicker = replicateM_ 20 (atomically (modifyTVar' condition not) >> yield)
    replicateM_ 500 . launching flicker $ \flickering -> do
      Signal.rSelect (dialled condition) branch branch
      awaitEnd flickering `shouldReturn` Gave ()
    readTVarIO ran `shouldReturn` 500
    mostInside occupancy `shouldReturn` 1

  it "does what the condition says when the old branch has ended, not when it changed" $ do
    book <- newLog
    condition <- newTVarIO 'a'
    entered <- newGate
    cleaning <- newGate
    release <- newGate
    let branch 'a' = do
          note book "a"
          (open entered >> hang) `onException` do
            open cleaning
            pass release
            note book "a is over"
        branch key = note book [key]
    launching (Signal.switch (dialled condition) branch) $ \caller -> do
      pass entered
      atomically (writeTVar condition 'b')
      pass cleaning
      atomically (writeTVar condition 'c')
      open release
      awaitEnd caller `shouldReturn` Gave ()
    notes book `shouldReturn` ["a", "a is over", "c"]

  it "runs the same branch anew when the condition has changed back meanwhile" $ do
    book <- newLog
    condition <- newTVarIO True
    entered <- newGate
    let left =
          notes book >>= \before ->
            if null before
              then do
                note book "left"
                -- The cleanup itself turns the condition back.
                (open entered >> hang) `onException` atomically (writeTVar condition True)
              else note book "left again"
        right = note book "right"
    launching (Signal.rSelect (dialled condition) left right) $ \caller -> do
      pass entered
      atomically (writeTVar condition False)
      awaitEnd caller `shouldReturn` Gave ()
    notes book `shouldReturn` ["left", "left again"]

  for_ [SaysFailure, SaysFault, SaysNothing] $ \news ->
    it ("starts nothing when the condition, read again, says " ++ show news) $ do
      book <- newLog
      condition <- newTestCondition True
      entered <- newGate
      let left = note book "left" >> (open entered >> hang) `onException` set condition news
          right = note book "right"
      launching (Signal.rSelect (watched condition) left right) $ \caller -> do
        pass entered
        set condition (Says False)
        awaitEnd caller `shouldReturn` expected news
      notes book `shouldReturn` ["left"]

  it "hears its own cancellation while a branch is slow to hear the stop, and stops its sensor then" $ do
    -- The branch is asked at 1.2, and hears nothing until 5. The caller is cancelled at 3:
    -- it no longer waits to be heard, and so has to ask again.
    readings' <- newIORef []
    let test = now >>= \t -> (t < 1) <$ modifyIORef readings' (t :)
        slow = uninterruptibleMask_ (sleep 5) >> sleep 100
    run <- simulate (timeout 3 (Signal.rSelect (Signal.polling 0.4 test) slow (pure ())))
    finished run `shouldBe` 5
    readIORef readings' >>= (`shouldSatisfy` (<= 3)) . maximum
 where
  expected news = case news of
    SaysFailure -> FailedWith "FailedBecause \"the sensor\""
    SaysFault -> FaultedWith (show (Fault "the sensor"))
    _ -> FailedWith "FailedBecause \"the signal has no value any more\""

-- | Something of which it is known only whether it is the same.
data Mode = Search | Fetch | Rest
  deriving (Eq)

switching :: Spec
switching =
  it "has a branch for each value of any type that can be compared" $ do
    book <- newLog
    mode <- newTVarIO Search
    let become next = atomically (writeTVar mode next)
        behave Search = note book "search" >> become Fetch >> hang
        behave Fetch = note book "fetch" >> become Rest >> hang
        behave Rest = note book "rest"
    Signal.switch (dialled mode) behave
    notes book `shouldReturn` ["search", "fetch", "rest"]

rules :: Spec
rules = do
  it "gives way to an earlier rule, and not to a later one" $ do
    book <- newLog
    [first, second, third] <- traverse newTVarIO [False, True, False]
    let turn variable = atomically . writeTVar variable
        one = note book "first"
        two = do
          note book "second"
          turn third True
          -- If it gave way to the third, it would be stopped before it could say so.
          mask_ (note book "second goes on")
          turn first True
          hang
        three = note book "third"
    Signal.teleoReactive (zip (map dialled [first, second, third]) [one, two, three])
    notes book `shouldReturn` ["second", "second goes on", "first"]

  it "goes on to the next rule that holds when its own no longer does" $ do
    book <- newLog
    first <- newTVarIO True
    let one = note book "first" >> atomically (writeTVar first False) >> hang
    Signal.teleoReactive
      [(dialled first, one), (pure False, note book "second"), (pure True, note book "third")]
    notes book `shouldReturn` ["first", "third"]

  it "waits while no rule holds, at first and later" $ do
    book <- newLog
    hungry <- newTVarIO False
    tired <- newTVarIO False
    entered <- newGate
    let turn variable = atomically . writeTVar variable
        eat = note book "eat" >> open entered >> hang
        sleeps = note book "sleep"
    launching (Signal.teleoReactive [(dialled tired, sleeps), (dialled hungry, eat)]) $ \caller -> do
      stillRunning caller
      turn hungry True
      pass entered
      turn hungry False
      stillRunning caller
      note book "now"
      turn tired True
      awaitEnd caller `shouldReturn` Gave ()
    notes book `shouldReturn` ["eat", "now", "sleep"]

  it "fails when a condition does, also while no rule holds" $ do
    condition <- newTestCondition False
    launching (Signal.teleoReactive [(watched condition, pure ()), (pure False, pure ())]) $ \caller -> do
      stillRunning caller
      set condition SaysFailure
      awaitEnd caller `shouldReturn` FailedWith "FailedBecause \"the sensor\""

waiting :: Spec
waiting = do
  it "returns when the condition holds, and not before" $ do
    condition <- newTestCondition False
    launching (Signal.waitUntil (watched condition)) $ \caller -> do
      stillRunning caller
      set condition (Says True)
      awaitEnd caller `shouldReturn` Gave ()

  for_ [SaysFailure, SaysFault, SaysNothing] $ \news ->
    it ("takes for an end, and not for false, that the condition says " ++ show news) $ do
      condition <- newTestCondition False
      launching (Signal.waitUntil (watched condition)) $ \caller -> do
        stillRunning caller
        set condition news
        awaitEnd caller >>= (`shouldSatisfy` (/= Gave ()))

  it "can be cancelled" $ do
    condition <- newTestCondition False
    cancelling (Signal.waitUntil (watched condition)) (pure ())
      `shouldReturn` CancelledBy (show (Cancel "the caller"))

holding :: Spec
holding =
  it "fails, once its branch has ended, when the condition stops holding" $ do
    book <- newLog
    condition <- newTestCondition True
    let grip = note book "grip" >> (set condition (Says False) >> hang) `onException` note book "let go"
    end <- ending (Signal.whileHolding (watched condition) grip `onException` note book "failed")
    end `shouldBe` (FailedWith "FailedBecause \"the condition does not hold\"" :: Ending ())
    notes book `shouldReturn` ["grip", "let go", "failed"]
