{-# LANGUAGE LambdaCase #-}

-- |
-- Which outcome a reactive operator has, when several things happened: one example for
-- every combination.
--
-- What cannot be forced on the real runtime: that a cancellation of the caller and
-- the end of a branch are found by one and the same look. A caller that waits in a
-- transaction is either interrupted there, or has its answer; which of the two is
-- GHC's choice.
module Behavior.OutcomeSpec (spec) where

import Control.Concurrent (myThreadId)
import Control.Concurrent.Async (asyncThreadId)
import Control.Concurrent.STM (check, newEmptyTMVarIO, putTMVar, readTMVar, readTVar)
import Control.Exception
import Control.Monad (unless, when)
import Data.Foldable (for_, traverse_)
import GHC.Conc (unsafeIOToSTM)
import Test.Hspec

import Behavior (Behavior)
import Behavior.Internal.Runtime (atomically)
import qualified Behavior.Signal as Signal
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "A branch that is stopped" stopped
  describe "A branch that has ended by itself, as the operator finds in the same look" tied
  describe "A caller that is cancelled" cancelled
  describe "monitor's recovery after a task that" recovering

-- | The condition stops holding, or its sensor dies, while the branch runs.
stopped :: Spec
stopped =
  for_ operators $ \op ->
    for_ [Says False, SaysFailure, SaysFault, SaysNothing] $ \news ->
      for_ [minBound .. maxBound] $ \how ->
        it (unwords [show op ++ ":", reason news ++ ", and the branch", manner how]) $ do
          occupancy <- newOccupancyCounter
          book <- newLog
          condition <- newTestCondition True
          entered <- newGate
          let main =
                inside occupancy $
                  notes book >>= \case
                    [] -> note book "main" >> onStop how "main" (open entered >> hang)
                    _ -> note book "main again" >> pure "main again"
              other = inside occupancy $ do
                note book "other"
                when (operator op == "monitor") (set condition (Says True))
                pure "other"
          end <- launching (running op (watched condition) main other) $ \caller -> do
            pass entered
            set condition news
            awaitEnd caller
          ran <- notes book
          (end, ran) `shouldBe` expected op news how
          mostInside occupancy `shouldReturn` 1
 where
  reason = \case
    Says _ -> "the condition changes"
    SaysFailure -> "the condition fails"
    SaysFault -> "the condition faults"
    SaysNothing -> "the condition loses its value"
  manner = \case
    Cleanly -> "stops"
    Completing -> "completes all the same"
    Failing -> "fails while it stops"
    Faulting -> "faults while it stops"
  expected op news how = case (how, news) of
    (Completing, _) -> (Gave "main", ["main"])
    (Failing, _) -> (FailedWith (show (Failure "main")), "main" : recovered)
    (Faulting, _) -> (FaultedWith (show (Fault "main")), "main" : recovered)
    (Cleanly, SaysFailure) -> (FailedWith "FailedBecause \"the sensor\"", ["main"])
    (Cleanly, SaysFault) -> (FaultedWith (show (Fault "the sensor")), ["main"])
    (Cleanly, SaysNothing) -> (FailedWith "FailedBecause \"the signal has no value any more\"", ["main"])
    (Cleanly, Says _) -> case operator op of
      "whileHolding" -> (FailedWith "FailedBecause \"the condition does not hold\"", ["main"])
      "monitor" -> (Gave "main again", ["main", "other", "main again"])
      _ -> (Gave "other", ["main", "other"])
   where
    recovered = ["other" | operator op == "monitor", news == Says False]

-- | The look that would find the news waits until the branch is over, so that both
-- are there: then the end of the branch counts.
tied :: Spec
tied =
  for_ operators $ \op ->
    for_ [Says False, SaysFailure, SaysFault, SaysNothing] $ \news ->
      for_ ends $ \(manner, finish, end) ->
        it (unwords [show op ++ ":", manner, "though the condition says", show news]) $ do
          book <- newLog
          thread <- newEmptyTMVarIO
          state <- newTestCondition True
          entered <- newGate
          let main = do
                note book "main"
                myThreadId >>= atomically . putTMVar thread
                open entered
                atomically (readTVar state >>= check . (== news))
                finish
              other = note book "other" >> pure "other"
              condition = Signal.watching $ do
                said <- readTVar state
                unless (said == Says True) $
                  readTMVar thread >>= unsafeIOToSTM . awaitOver
                says state
          result <- launching (running op condition main other) $ \caller -> do
            pass entered
            awaitIdle (asyncThreadId caller)
            set state news
            awaitEnd caller
          result `shouldBe` end
          notes book `shouldReturn` ["main"]
 where
  ends =
    [ ("it has completed", pure "main", Gave "main")
    , ("it has failed", throwIO (Failure "main"), FailedWith (show (Failure "main")))
    , ("it has faulted", throwIO (Fault "main"), FaultedWith (show (Fault "main")))
    ] ::
      [(String, Behavior String, Ending String)]

-- | Both of a caller that can be interrupted anywhere, and of one that can be
-- interrupted only where it waits.
cancelled :: Spec
cancelled = do
  for_ [("", id), (" (masked)", mask_)] $ \(state, masked) ->
    for_ operators $ \op ->
      for_ [minBound .. maxBound] $ \how ->
        it (show op ++ state ++ ": is cancelled, if its branch then " ++ manner how) $ do
          book <- newLog
          condition <- newTestCondition True
          entered <- newGate
          let main = do
                note book "main"
                onStop how "main" (open entered >> hang)
              other = note book "other" >> pure "other"
              -- A handler for what the branch throws must not run: that the
              -- behaviour was cancelled is the end of the matter.
              caller =
                try (masked (running op (watched condition) main other)) >>= \case
                  Left e -> "went on" <$ note book (show (e :: Fault))
                  Right a -> a <$ note book "went on"
          cancelling (leavingNothing caller) (pass entered) `shouldReturn` expected how
          notes book `shouldReturn` ["main"]

  for_ operators $ \op -> do
    it (show op ++ ": loses a result that it has not returned yet") $ do
      (end, ran) <- afterwards op id
      end `shouldBe` CancelledBy (show (Cancel "the caller"))
      ran `shouldBe` ["main"]
    it (show op ++ ": returns its result, where it can not be cancelled before") $ do
      (end, ran) <- afterwards op mask_
      end `shouldBe` CancelledBy (show (Cancel "the caller"))
      ran `shouldBe` ["main", "returned main"]
 where
  manner = \case
    Cleanly -> "stops"
    Completing -> "completes all the same"
    Failing -> "fails"
    Faulting -> "faults: with both"
  expected = \case
    Faulting -> CancelledWithFault (show (Cancel "the caller")) (show (Fault "main"))
    _ -> CancelledBy (show (Cancel "the caller"))

-- | The caller is cancelled after its branch has completed, while the operator waits
-- for a reading that cannot be interrupted.
afterwards :: Operator -> (IO () -> IO ()) -> IO (Ending (), [String])
afterwards op masked = do
  book <- newLog
  entered <- newGate
  hanging <- newGate
  release <- newGate
  thermometer <- newSensor $ \_ -> do
    enough <- opened entered
    when enough (uninterruptibleMask_ (open hanging >> pass release))
    pure True
  threads <- newLog
  let main = (myThreadId >>= note threads) >> note book "main" >> open entered >> pass hanging >> pure "main"
      other = note book "other" >> pure "other"
      act = do
        masked $ do
          result <- running op (sensing thermometer) main other
          note book ("returned " ++ result)
        note book "went on"
  end <- launching act $ \caller -> do
    let self = asyncThreadId caller
    pass hanging
    notes threads >>= traverse_ awaitOver
    readMessages
    awaitUnheard self
    throwing self (Cancel "the caller")
    open release
    awaitEnd caller
  (,) end <$> notes book

-- | What becomes of the operator when the task, the recovery or both go wrong.
recovering :: Spec
recovering =
  for_ [minBound .. maxBound] $ \task ->
    for_ [Completing, Failing, Faulting] $ \recovery ->
      it (unwords [manner task, "while it stops, and then", manner recovery]) $ do
        book <- newLog
        condition <- newTestCondition False
        entered <- newGate
        let main =
              notes book >>= \case
                [] -> do
                  note book "task"
                  onStop task "task" (open entered >> hang) `finally` note book "task over"
                _ -> note book "task again" >> pure "task again"
            recover = do
              note book "recovery"
              set condition (Says False)
              act recovery
        end <- launching (Signal.monitor (watched condition) recover main) $ \caller -> do
          pass entered
          set condition (Says True)
          awaitEnd caller
        (,) end <$> notes book `shouldReturn` expected task recovery
 where
  act = \case
    Failing -> throwIO (Failure "recovery")
    Faulting -> throwIO (Fault "recovery")
    _ -> pure ()
  manner = \case
    Cleanly -> "stops"
    Completing -> "completes"
    Failing -> "fails"
    Faulting -> "faults"
  expected task recovery = case (task, recovery) of
    -- No lost work: there is a result, so there is no recovery.
    (Completing, _) -> (Gave "task", ["task", "task over"])
    (Cleanly, Completing) -> (Gave "task again", recovered ++ ["task again"])
    (Cleanly, Failing) -> (FailedWith (show (Failure "recovery")), recovered)
    (Cleanly, _) -> (FaultedWith (show (Fault "recovery")), recovered)
    (Failing, Faulting) -> (FaultedWith (show (Fault "recovery")), recovered)
    (Failing, _) -> (FailedWith (show (Failure "task")), recovered)
    (Faulting, _) -> (FaultedWith (show (Fault "task")), recovered)
  recovered = ["task", "task over", "recovery"]
