-- |
-- What every reactive operator promises, on conditions that are watched. How each ends
-- when several things happen is in "Behavior.OutcomeSpec".
module Behavior.OperatorsSpec (spec) where

import Control.Concurrent (yield)
import Control.Concurrent.Async (asyncThreadId)
import Control.Concurrent.STM (modifyTVar', newTVarIO)
import Control.Exception
import Control.Monad (replicateM_, void, when)
import Data.Foldable (for_)
import Test.Hspec

import Behavior.Internal.Runtime (Event (..), Label (..), atomically, withSink)
import Support
import Watched

spec :: Spec
spec = guarded . for_ operators $ \op -> describe (show op) $ do
  it "starts nothing before the condition has a value" $ do
    book <- newLog
    condition <- newTVarIO SaysNothing
    asked <- newGate
    let main = note book "main" >> pure "main"
        other = note book "other" >> pure "other"
    launching (open asked >> running op (watched condition) main other) $ \caller -> do
      pass asked
      stillRunning caller
      note book "now"
      set condition (Says True)
      awaitEnd caller `shouldReturn` Gave "main"
    notes book `shouldReturn` ["now", "main"]

  for_ [SaysFailure, SaysFault] $ \news ->
    it ("starts nothing when the condition at first " ++ show news) $ do
      book <- newLog
      condition <- newTVarIO news
      let branch = note book "ran" >> pure "ran"
      ending (running op (watched condition) branch branch) >>= (`shouldSatisfy` sensorsOwn news)
      notes book `shouldReturn` []

  for_ [("unmasked", id), ("masked", mask_), ("uninterruptible", uninterruptibleMask_)] $
    \(state, masked) ->
      it ("runs every branch unmasked for a caller that is " ++ state) $ do
        states <- newLog
        condition <- newTestCondition True
        entered <- newGate
        let noting = getMaskingState >>= note states
            main = do
              again <- (/= []) <$> notes states
              noting
              if again then pure "main" else open entered >> hang
            other = noting >> recovered op condition >> pure "other"
        launching (masked (running op (watched condition) main other)) $ \caller -> do
          pass entered
          set condition (Says False)
          void (awaitEnd caller)
        notes states >>= (`shouldSatisfy` \all' -> not (null all') && all (== Unmasked) all')

  it "ends after the cleanup of its branch, though the caller is cancelled twice" $ do
    book <- newLog
    condition <- newTestCondition True
    entered <- newGate
    cleaning <- newGate
    release <- newGate
    let main =
          uninterruptibly (open entered >> hang) $ do
            open cleaning
            pass release
            note book "main is over"
        other = pure "other"
        act = running op (watched condition) main other `onException` note book "operator is over"
    launching act $ \caller -> do
      pass entered
      throwing (asyncThreadId caller) (Cancel "once")
      pass cleaning
      throwing (asyncThreadId caller) (Cancel "twice")
      open release
      awaitEnd caller `shouldReturn` CancelledBy (show (Cancel "once"))
    notes book `shouldReturn` ["main is over", "operator is over"]

  it "can be cancelled at any moment" $
    -- With the next one the caller is a little further on, or not.
    replicateM_ 500 $ do
      let act = leavingNothing (running op (pure True) hang hang)
      cancelling act (pure ()) `shouldReturn` CancelledBy (show (Cancel "the caller"))

  it "does not look again while nothing changes that it looks at" $ do
    condition <- newRecorded True
    other <- newTVarIO (0 :: Int)
    entered <- newGate
    launching (running op (recorded condition) (open entered >> hang) hang) $ \caller -> do
      pass entered
      awaitIdle (asyncThreadId caller)
      earlier <- looks condition (const True) True
      replicateM_ 1000 (atomically (modifyTVar' other (+ 1)) >> yield)
      looks condition (const True) True `shouldReturn` earlier

  for_ [1 .. 3] $ \level -> do
    it ("nested in itself three times, is stopped at level " ++ show level) $ do
      (end, ran) <- nested op level (pure ())
      (end, ran) `shouldBe` case operator op of
        "whileHolding" -> (FailedWith "FailedBecause \"the condition does not hold\"", ["main"])
        "monitor" -> (Gave "main again", ["main", show level, "main again"])
        _ -> (Gave (show level), ["main", show level])
    it ("nested in itself three times, throws the fault met by stopping level " ++ show level) $ do
      (end, ran) <- nested op level (throwIO (Fault "main"))
      end `shouldBe` FaultedWith (show (Fault "main"))
      ran `shouldBe` "main" : [show level | operator op == "monitor"]

  it "labels every thread with the operator and its branch" $ do
    events <- newLog
    condition <- newTestCondition True
    entered <- newGate
    visits <- newLog
    let main = do
          note visits ()
          again <- (> 1) . length <$> notes visits
          if again then pure "main" else open entered >> hang
        other = recovered op condition >> pure "other"
    withSink (note events) $
      launching (running op (watched condition) main other) $ \caller -> do
        pass entered
        set condition (Says False)
        void (awaitEnd caller)
    reported <- notes events
    [label | Started label <- reported] `shouldBe` map (Label (operator op)) (branches op)
    -- Each has ended before the next was started.
    reported `shouldBe` concat [[Started label, Ended label] | Started label <- reported]
 where
  sensorsOwn news end = case (news, end) of
    (SaysFailure, FailedWith why) -> why == "FailedBecause \"the sensor\""
    (_, FaultedWith what) -> news == SaysFault && what == show (Fault "the sensor")
    _ -> False
  branches op = case operator op of
    "rSelect" -> ["left", "right"]
    "monitor" -> ["task", "recovery", "task"]
    "switch" -> ["branch", "branch"]
    "teleoReactive" -> ["rule 1", "rule 2"]
    _ -> ["branch"]

-- | One operator inside another of its kind inside a third; the condition of one of
-- them, counted from outside, changes while the innermost branch runs.
nested :: Operator -> Int -> IO () -> IO (Ending String, [String])
nested op level cleanup = do
  book <- newLog
  entered <- newGate
  dials <- traverse (const (newTestCondition True)) [1 .. 3 :: Int]
  let main = do
        again <- (/= []) <$> notes book
        if again
          then note book "main again" >> pure "main again"
          else note book "main" >> (open entered >> hang) `onException` cleanup
      other n condition = do
        note book (show n)
        recovered op condition
        pure (show n)
      wrap (n, condition) inner = running op (watched condition) inner (other n condition)
  end <- launching (foldr wrap main (zip [1 :: Int ..] dials)) $ \caller -> do
    pass entered
    set (dials !! (level - 1)) (Says False)
    awaitEnd caller
  (,) end <$> notes book

-- | The recovery of @monitor@ makes good what it was started for. (The second branch of
-- the others would be stopped by that.)
recovered :: Operator -> TestCondition -> IO ()
recovered op condition = when (operator op == "monitor") (set condition (Says True))
