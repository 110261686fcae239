{-# LANGUAGE LambdaCase #-}

-- |
-- Which outcome a reactive operator has, when several things happened: one example for
-- every combination.
--
-- One case cannot be forced on the real runtime: that a single transaction of the
-- operator finds both a cancellation of the caller and the end of a branch. A caller that
-- waits in a transaction either is interrupted there or gets its result; GHC chooses which.
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
import Behavior.Internal.Seam.Runtime (atomically)
import qualified Behavior.Signal as Signal
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "A branch that is stopped" stopped
  describe "A branch that has ended by itself, found together with a change of the condition" tied
  describe "A caller that is cancelled" cancelled
  describe "monitor, whose condition becomes true:" recovering

-- | The condition stops holding, or its sensor fails, faults or loses its value, while the
-- branch runs.
stopped :: Spec
stopped =
  for_ operators $ \op ->
    for_ [Value False, SensorFailure, SensorFault, NoValue] $ \newState ->
      for_ [minBound .. maxBound] $ \how ->
        it (unwords [show op ++ ":", reason newState ++ ", and the branch", manner how]) $ do
          occupancy <- newOccupancyCounter
          entries <- newLog
          condition <- newTestCondition True
          entered <- newGate
          let main =
                inside occupancy $
                  notes entries >>= \case
                    [] -> note entries "main" >> onStop how "main" (open entered >> hang)
                    _ -> note entries "main again" >> pure "main again"
              other = inside occupancy $ do
                note entries "other"
                when (operator op == "monitor") (set condition (Value True))
                pure "other"
          end <- withThread (running op (watched condition) main other) $ \caller -> do
            pass entered
            set condition newState
            awaitEnd caller
          ran <- notes entries
          (end, ran) `shouldBe` expected op newState how
          mostInside occupancy `shouldReturn` 1
 where
  reason = \case
    Value _ -> "the condition changes"
    SensorFailure -> "the condition fails"
    SensorFault -> "the condition faults"
    NoValue -> "the condition loses its value"
  manner = \case
    Cleanly -> "stops"
    Completing -> "nevertheless completes"
    Failing -> "fails while it stops"
    Faulting -> "faults while it stops"
  expected op newState how = case (how, newState) of
    (Completing, _) -> (Gave "main", ["main"])
    (Failing, _) -> (FailedWith (show (Failure "main")), "main" : recovered)
    (Faulting, _) -> (FaultedWith (show (Fault "main")), "main" : recovered)
    (Cleanly, SensorFailure) -> (FailedWith "FailedBecause \"the sensor\"", ["main"])
    (Cleanly, SensorFault) -> (FaultedWith (show (Fault "the sensor")), ["main"])
    (Cleanly, NoValue) -> (FailedWith "FailedBecause \"the signal has no value any more\"", ["main"])
    (Cleanly, Value _) -> case operator op of
      "whileHolding" -> (FailedWith "FailedBecause \"the condition does not hold\"", ["main"])
      "monitor" -> (Gave "main again", ["main", "other", "main again"])
      _ -> (Gave "other", ["main", "other"])
   where
    recovered = ["other" | latched op, newState == Value False]

-- | The transaction that reads the change waits until the branch has ended, so that it
-- finds both: then the end of the branch counts.
tied :: Spec
tied =
  for_ operators $ \op ->
    for_ [Value False, SensorFailure, SensorFault, NoValue] $ \newState ->
      for_ ends $ \(manner, finish, end) ->
        it (unwords [show op ++ ":", manner, "though the condition's state is", show newState]) $ do
          entries <- newLog
          thread <- newEmptyTMVarIO
          state <- newTestCondition True
          entered <- newGate
          let main = do
                note entries "main"
                myThreadId >>= atomically . putTMVar thread
                open entered
                atomically (readTVar state >>= check . (== newState))
                finish
              other = note entries "other" >> pure "other"
              condition = Signal.watching $ do
                current <- readTVar state
                unless (current == Value True) $
                  readTMVar thread >>= unsafeIOToSTM . awaitOver
                readCondition state
          result <- withThread (running op condition main other) $ \caller -> do
            pass entered
            awaitIdle (asyncThreadId caller)
            set state newState
            awaitEnd caller
          result `shouldBe` end
          notes entries `shouldReturn` ["main"]
 where
  ends =
    [ ("it has completed", pure "main", Gave "main")
    , ("it has failed", throwIO (Failure "main"), FailedWith (show (Failure "main")))
    , ("it has faulted", throwIO (Fault "main"), FaultedWith (show (Fault "main")))
    ] ::
      [(String, Behavior String, Ending String)]

-- | Both for a caller that can be interrupted anywhere, and for one that can be
-- interrupted only where it blocks.
cancelled :: Spec
cancelled = do
  for_ [("", id), (" (masked)", mask_)] $ \(state, masked) ->
    for_ operators $ \op ->
      for_ [minBound .. maxBound] $ \how ->
        it (show op ++ state ++ ": is cancelled, and its branch then " ++ manner how) $ do
          entries <- newLog
          condition <- newTestCondition True
          entered <- newGate
          let main = do
                note entries "main"
                onStop how "main" (open entered >> hang)
              other = note entries "other" >> pure "other"
              -- A handler for what the branch throws must not run: the cancellation
              -- takes precedence.
              caller =
                try (masked (running op (watched condition) main other)) >>= \case
                  Left e -> "went on" <$ note entries (show (e :: Fault))
                  Right a -> a <$ note entries "went on"
          cancelling (leavingNothing caller) (pass entered) `shouldReturn` expected how
          notes entries `shouldReturn` ["main"]

  for_ operators $ \op -> do
    it (show op ++ ": loses a result that it has not returned yet") $ do
      (end, ran) <- afterwards op id
      end `shouldBe` CancelledBy (show (Cancel "the caller"))
      ran `shouldBe` ["main"]
    it (show op ++ ": returns its result where it cannot be cancelled before") $ do
      (end, ran) <- afterwards op mask_
      end `shouldBe` CancelledBy (show (Cancel "the caller"))
      ran `shouldBe` ["main", "returned main"]
 where
  manner = \case
    Cleanly -> "stops"
    Completing -> "nevertheless completes"
    Failing -> "fails"
    Faulting -> "faults: the exception holds both"
  expected = \case
    Faulting -> CancelledWithFault (show (Cancel "the caller")) (show (Fault "main"))
    _ -> CancelledBy (show (Cancel "the caller"))

-- | The caller is cancelled after its branch has completed, while the operator waits
-- for a reading that cannot be interrupted.
afterwards :: Operator -> (IO () -> IO ()) -> IO (Ending (), [String])
afterwards op masked = do
  entries <- newLog
  entered <- newGate
  hanging <- newGate
  release <- newGate
  thermometer <- newSensor $ \_ -> do
    enough <- opened entered
    when enough (uninterruptibleMask_ (open hanging >> pass release))
    pure True
  threads <- newLog
  let main = (myThreadId >>= note threads) >> note entries "main" >> open entered >> pass hanging >> pure "main"
      other = note entries "other" >> pure "other"
      act = do
        masked $ do
          result <- running op (sensing thermometer) main other
          note entries ("returned " ++ result)
        note entries "went on"
  end <- withThread act $ \caller -> do
    let self = asyncThreadId caller
    pass hanging
    notes threads >>= traverse_ awaitOver
    readMessages
    awaitBlockedByThread self
    throwing self (Cancel "the caller")
    open release
    awaitEnd caller
  (,) end <$> notes entries

-- | How the operator ends when the task, the recovery or both fail or fault.
recovering :: Spec
recovering =
  for_ [minBound .. maxBound] $ \task ->
    for_ [Completing, Failing, Faulting] $ \recovery ->
      it (unwords ["the task, when stopped,", manner task ++ "; the recovery, if it runs,", manner recovery]) $ do
        entries <- newLog
        condition <- newTestCondition False
        entered <- newGate
        let main =
              notes entries >>= \case
                [] -> do
                  note entries "task"
                  onStop task "task" (open entered >> hang) `finally` note entries "task over"
                _ -> note entries "task again" >> pure "task again"
            recover = do
              note entries "recovery"
              set condition (Value False)
              act recovery
        end <- withThread (Signal.monitor (watched condition) recover main) $ \caller -> do
          pass entered
          set condition (Value True)
          awaitEnd caller
        (,) end <$> notes entries `shouldReturn` expected task recovery
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
    -- No work is lost: there is a result, so there is no recovery.
    (Completing, _) -> (Gave "task", ["task", "task over"])
    (Cleanly, Completing) -> (Gave "task again", recovered ++ ["task again"])
    (Cleanly, Failing) -> (FailedWith (show (Failure "recovery")), recovered)
    (Cleanly, _) -> (FaultedWith (show (Fault "recovery")), recovered)
    (Failing, Faulting) -> (FaultedWith (show (Fault "recovery")), recovered)
    (Failing, _) -> (FailedWith (show (Failure "task")), recovered)
    (Faulting, _) -> (FaultedWith (show (Fault "task")), recovered)
  recovered = ["task", "task over", "recovery"]
