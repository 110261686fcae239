-- |
-- The promises of every reactive operator, on watched conditions. How each ends when
-- several things happen is in "Behavior.OutcomeSpec".
module Behavior.OperatorsSpec (spec) where

import Control.Concurrent (yield)
import Control.Concurrent.Async (asyncThreadId)
import Control.Concurrent.STM (modifyTVar', newTVarIO)
import Control.Exception
import Control.Monad (replicateM_, void, when)
import Data.Foldable (for_)
import Test.Hspec

import Behavior.Internal.Seam.Runtime (Label (..), atomically)
import Support
import Watched

spec :: Spec
spec = guarded . for_ operators $ \op -> describe (show op) $ do
  it "starts nothing before the condition has a value" $ do
    entries <- newLog
    condition <- newTVarIO NoValue
    called <- newGate
    let main = note entries "main" >> pure "main"
        other = note entries "other" >> pure "other"
    withThread (open called >> running op (watched condition) main other) $ \caller -> do
      pass called
      stillRunning caller
      note entries "now"
      set condition (Value True)
      awaitEnd caller `shouldReturn` Gave "main"
    notes entries `shouldReturn` ["now", "main"]

  for_ [SensorFailure, SensorFault] $ \newState ->
    it ("starts nothing when the condition's first state is " ++ show newState) $ do
      entries <- newLog
      condition <- newTVarIO newState
      let branch = note entries "ran" >> pure "ran"
      ending (running op (watched condition) branch branch) >>= (`shouldSatisfy` isTheSensors newState)
      notes entries `shouldReturn` []

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
        withThread (masked (running op (watched condition) main other)) $ \caller -> do
          pass entered
          set condition (Value False)
          void (awaitEnd caller)
        notes states >>= (`shouldSatisfy` \known -> not (null known) && all (== Unmasked) known)

  it "ends after the cleanup of its branch, though the caller is cancelled twice" $ do
    entries <- newLog
    condition <- newTestCondition True
    entered <- newGate
    cleaning <- newGate
    release <- newGate
    let main =
          uninterruptibly (open entered >> hang) $ do
            open cleaning
            pass release
            note entries "main is over"
        other = pure "other"
        act = running op (watched condition) main other `onException` note entries "operator is over"
    withThread act $ \caller -> do
      pass entered
      throwing (asyncThreadId caller) (Cancel "once")
      pass cleaning
      throwing (asyncThreadId caller) (Cancel "twice")
      open release
      awaitEnd caller `shouldReturn` CancelledBy (show (Cancel "once"))
    notes entries `shouldReturn` ["main is over", "operator is over"]

  it "can be cancelled at any moment" $
    -- How far the caller has got differs from one round to the next.
    replicateM_ 500 $ do
      let act = leavingNothing (running op (pure True) hang hang)
      cancelling act (pure ()) `shouldReturn` CancelledBy (show (Cancel "the caller"))

  it "does not read its condition again while the condition's variables do not change" $ do
    condition <- newRecorded True
    other <- newTVarIO (0 :: Int)
    entered <- newGate
    withThread (running op (recorded condition) (open entered >> hang) hang) $ \caller -> do
      pass entered
      awaitIdle (asyncThreadId caller)
      earlier <- readCount condition (const True) True
      replicateM_ 1000 (atomically (modifyTVar' other (+ 1)) >> yield)
      readCount condition (const True) True `shouldReturn` earlier

  for_ [1 .. 3] $ \level -> do
    it ("nested in itself three times, is stopped at level " ++ show level) $ do
      (end, ran) <- nested op level (pure ())
      (end, ran) `shouldBe` case operator op of
        "whileHolding" -> (FailedWith "FailedBecause \"the condition does not hold\"", ["main"])
        "monitor" -> (Gave "main again", ["main", show level, "main again"])
        _ -> (Gave (show level), ["main", show level])
    it ("nested in itself three times, throws the branch's fault when level " ++ show level ++ " is stopped") $ do
      (end, ran) <- nested op level (throwIO (Fault "main"))
      end `shouldBe` FaultedWith (show (Fault "main"))
      ran `shouldBe` "main" : [show level | latched op]

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
    watchingThreads (note events) $
      withThread (running op (watched condition) main other) $ \caller -> do
        pass entered
        set condition (Value False)
        void (awaitEnd caller)
    reported <- notes events
    [label | Started label <- reported] `shouldBe` map (Label (operator op)) (branches op)
    -- Each has ended before the next was started.
    reported `shouldBe` concat [[Started label, Ended label] | Started label <- reported]
 where
  isTheSensors newState end = case (newState, end) of
    (SensorFailure, FailedWith why) -> why == "FailedBecause \"the sensor\""
    (_, FaultedWith what) -> newState == SensorFault && what == show (Fault "the sensor")
    _ -> False
  branches op = case operator op of
    "rSelect" -> ["left", "right"]
    "monitor" -> ["task", "recovery", "task"]
    "insteadWhen" -> ["branch", "emergency"]
    "switch" -> ["branch", "branch"]
    "teleoReactive" -> ["rule 1", "rule 2"]
    _ -> ["branch"]

-- | An operator inside another of its kind inside a third; the condition of the one with
-- the given number, counted from outside, changes while the innermost branch runs.
nested :: Operator -> Int -> IO () -> IO (Ending String, [String])
nested op level cleanup = do
  entries <- newLog
  entered <- newGate
  conditions <- traverse (const (newTestCondition True)) [1 .. 3 :: Int]
  let main = do
        again <- (/= []) <$> notes entries
        if again
          then note entries "main again" >> pure "main again"
          else note entries "main" >> (open entered >> hang) `onException` cleanup
      other n condition = do
        note entries (show n)
        recovered op condition
        pure (show n)
      wrap (n, condition) inner = running op (watched condition) inner (other n condition)
  end <- withThread (foldr wrap main (zip [1 :: Int ..] conditions)) $ \caller -> do
    pass entered
    set (conditions !! (level - 1)) (Value False)
    awaitEnd caller
  (,) end <$> notes entries

-- | The recovery of @monitor@ sets the condition so that the task may run. (With the other
-- operators this would stop the second branch.)
recovered :: Operator -> TestCondition -> IO ()
recovered op condition = when (operator op == "monitor") (set condition (Value True))
