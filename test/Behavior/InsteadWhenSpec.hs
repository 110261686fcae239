-- |
-- 'Signal.insteadWhen': its one switch. Its promises in common with the other operators are in
-- "Behavior.ReactiveSpec", and how it ends when several things happen is in "Behavior.OutcomeSpec".
module Behavior.InsteadWhenSpec (spec) where

import Control.Concurrent.STM (newTVarIO, readTVarIO, writeTVar)
import Control.Exception (onException, throwIO)
import Control.Monad (when)
import Data.Foldable (for_)
import Data.IORef (modifyIORef', newIORef, readIORef)
import Test.Hspec
import Test.Hspec.QuickCheck (prop)

import Behavior
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Sim (exhaustively, explore)
import Support
import Watched

spec :: Spec
spec = guarded . describe "insteadWhen" $ do
  prop "with a constant condition is one behaviour or the other" $ \c a b ->
    sameAs
      (\entries -> Signal.insteadWhen (pure c) (play entries a) (play entries b))
      (\entries -> play entries (if c then a else b))

  it "runs the emergency to its end, however the condition changes, and gives its result" $ do
    entries <- newLog
    condition <- newTestCondition False
    entered <- newGate
    release <- newGate
    let emergency = (open entered >> pass release >> note entries "landed" >> pure "landed")
          `onException` note entries "interrupted"
    end <- withThread (Signal.insteadWhen (watched condition) emergency (set condition (Value True) >> hang)) $
      \caller -> do
        pass entered
        for_ [Value False, Value True, SensorFailure, SensorFault, NoValue, Value False] $ \newState -> do
          set condition newState
          stillRunning caller
        open release
        awaitEnd caller
    (,) end <$> notes entries `shouldReturn` (Gave "landed", ["landed"])

  it "has no way back: the act does not start again when the emergency has ended" $ do
    entries <- newLog
    condition <- newTestCondition False
    let act = note entries "act" >> set condition (Value True) >> hang
    Signal.insteadWhen (watched condition) (note entries "emergency" >> set condition (Value False)) act
    notes entries `shouldReturn` ["act", "emergency"]

  it "runs no emergency because the act fails, or when it has ended by itself" $ do
    entries <- newLog
    let with = Signal.insteadWhen (pure False) (note entries "emergency")
    ending (with failed) `shouldReturn` FailedWith "Failed"
    ending (with (throwIO (Fault "motor"))) `shouldReturn` FaultedWith (show (Fault "motor"))
    with (pure ())
    notes entries `shouldReturn` []

  it "ends by the emergency's failure or fault" $ do
    ending (Signal.insteadWhen (pure True) failed hang) `shouldReturn` (FailedWith "Failed" :: Ending ())
    ending (Signal.insteadWhen (pure True) (throwIO (Fault "motor")) hang)
      `shouldReturn` (FaultedWith (show (Fault "motor")) :: Ending ())

  describe "A drone that must land when the wind rises, and stay there," $
    for_ [("", pure ()), (", though its camera faults while it is stopped", throwIO camera)] $ \(though, closing) -> do
      it ("does so under all schedules" ++ though) $
        remainingUp closing Signal.insteadWhen `shouldReturn` 0
      it ("does not when the landing is one branch of rSelect" ++ though) $
        remainingUp closing Signal.rSelect >>= (`shouldSatisfy` (> 0))
  it "A drone whose landing is a fallback of whileHolding does not land when its camera faults" $ do
    let fallingBack condition land survey = Signal.whileHolding (not <$> condition) survey ? land
    remainingUp (pure ()) fallingBack `shouldReturn` 0
    remainingUp (throwIO camera) fallingBack >>= (`shouldSatisfy` (> 0))

camera :: Fault
camera = Fault "camera"

-- | In how many schedules, of those with up to one pre-emption, the drone has not landed at the end.
-- The wind rises, and calms down while the drone lands.
remainingUp :: Behavior () -> (Signal.Signal Bool -> Behavior () -> Behavior () -> Behavior ()) -> IO Int
remainingUp closing interrupting = do
  up <- newIORef 0
  _ <- explore (exhaustively 1) $ \simulated -> do
    windy <- newTVarIO False
    flying <- newTVarIO True
    let wind = sleep 5 >> atomically (writeTVar windy True) >> sleep 1 >> atomically (writeTVar windy False) >> sleep 20
        land = sleep 4 >> atomically (writeTVar flying False)
        survey = (atomically (writeTVar flying True) >> sleep 3600) `onException` closing
    _ <- simulated (interrupting (watchedVar windy) land survey ||| wind)
    readTVarIO flying >>= \is -> when is (modifyIORef' up (+ 1))
  readIORef up
