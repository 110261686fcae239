-- |
-- The errors of the paper as printed, and what this package does instead, in the order of
-- the table of errata.
module Paper.ErrataSpec (spec) where

import Control.Concurrent.STM (modifyTVar', newTVarIO, readTVar, readTVarIO)
import Control.Exception (MaskingState (..), PatternMatchFail, getMaskingState, throwIO)
import Control.Monad (void, when)
import Data.Foldable (for_)
import Data.List (isInfixOf)
import Test.Hspec

import Behavior
import qualified Behavior.Paper as Paper
import Behavior.STM (atomically)
import qualified Paper.AsPrinted.PassDoor as PassDoor
import Paper.AsPrinted.Signatures ()
import qualified Paper.AsPrinted.ThreeTimes as ThreeTimes
import qualified Paper.Attempt as Attempt
import qualified Paper.FallbackByCatch as FallbackByCatch
import qualified Paper.FallbackOverList as FallbackOverList
import qualified Paper.FrontDoorFirst as FrontDoorFirst
import qualified Paper.MovedOut as MovedOut
import qualified Paper.SequenceAsSelection as SequenceAsSelection
import Paper.Stage
import qualified Robot
import Support (Ending (..), Fault (..), ending, guarded)
import World

spec :: Spec
spec = guarded $ do
  describe "passDoor, Section 3.1" $
    it "as printed has a type error" $
      playing still [] (void PassDoor.passDoor) >>= (`shouldSatisfy` endedByTypeError)

  describe "a sequence as a reactive selection, Section 3.2" $
    it "does not go on to the second action when the first completes" $
      playing still [] SequenceAsSelection.bt `shouldReturn` (Gave (), [Did "a1"])

  describe "monitor insideRoom, Section 3.4" $ do
    it "as printed leaves the room and closes the door from outside" $
      playingIn still {frontIs = Open} [] (\world -> (InsideRoom `becomes` True) world >> MovedOut.bt)
        `shouldReturn` (Gave (), [Did "pass through front door", Did "close front door"])
    it "as printed closes the door at once when it is outside" $
      playing still {frontIs = Open} [] MovedOut.bt
        `shouldReturn` (Gave (), [Did "close front door"])
    it "with `not` passes through to the end, and passes through again when it is moved out" $
      playing
        still {frontIs = Open}
        [During "close front door" (untilInterrupted (InsideRoom `becomes` False))]
        (Paper.monitor (Paper.not Robot.insideRoom) (Robot.passThrough Robot.door) (Robot.close Robot.door))
        `shouldReturn` ( Gave ()
                       , [ Did "pass through front door"
                         , InterruptedIn "close front door"
                         , Did "pass through front door"
                         , Did "close front door"
                         ]
                       )

  describe "fallback by catch, Section 5" $ do
    for_ [("fallback", FallbackByCatch.fallback), ("?", (FallbackByCatch.?))] $ \(name, orElse) ->
      it (name ++ " as printed runs its second behaviour masked") $
        (failed `orElse` (show <$> getMaskingState)) `shouldReturn` show MaskedInterruptible
    it "in this package does not" $
      (failed ? getMaskingState) `shouldReturn` Unmasked

  describe "the first version, Section 6" $ do
    it "as printed opens the front door although it is open, and does the task without passing through" $
      playing still {frontIs = Open} [] FrontDoorFirst.bt
        `shouldReturn` (Gave (), [Did "open front door", Did "do task"])
    it "as printed does not open the front door although it is closed" $
      playing still {backIs = Sealed} [] FrontDoorFirst.bt
        `shouldReturn` ( failedBecause "the back door is sealed"
                       , [ FailedTo "pass through front door" "the front door is not open"
                         , FailedTo "open back door" "the back door is sealed"
                         , FailedTo "smash back door" "the back door is sealed"
                         ]
                       )

  describe "fallback over a list, Section 6" $ do
    it "as printed faults when everything has failed, and ? does not catch that" $ do
      (FallbackOverList.fallback doors (const failed) :: Behavior ()) `shouldThrow` patternMatchFail
      (FallbackOverList.fallback doors (const failed) ? pure "recovered") `shouldThrow` patternMatchFail
    it "in this package fails with the last failure, which ? catches" $ do
      ending (Paper.fallback doors (failWith . show) :: Behavior ())
        `shouldReturn` failedBecause (show BackDoor)
      (Paper.fallback doors (const failed) ? pure "recovered") `shouldReturn` "recovered"
      (Paper.fallback (drop 2 doors) pure ? pure FrontDoor) `shouldReturn` FrontDoor

  describe "attempt, Section 6" $ do
    it "as printed has a type error where it is used" $
      playing still [] (void ThreeTimes.bt) >>= (`shouldSatisfy` endedByTypeError)
    it "as printed never ends for a negative number" $
      counting (Attempt.attempt (-1 :: Int)) `shouldReturn` (FaultedWith (show enough), 1000)
    it "as printed loses the last failure" $
      ending (Attempt.attempt (2 :: Int) (failWith "stuck") :: Behavior ())
        `shouldReturn` FailedWith (show Failed)
    it "in this package fails for a negative number, and runs nothing" $
      counting (Paper.attempt (-1)) `shouldReturn` (FailedWith (show Failed), 0)
    it "in this package throws the last failure" $
      ending (Paper.attempt 2 (failWith "stuck" :: Behavior ()))
        `shouldReturn` failedBecause "stuck"
 where
  doors = [FrontDoor, BackDoor]
  patternMatchFail = const True :: Selector PatternMatchFail

-- | Whether it ended with a type error that GHC had deferred to run time.
endedByTypeError :: (Ending a, [Step]) -> Bool
endedByTypeError (FaultedWith why, _) = "(deferred type error)" `isInfixOf` why
endedByTypeError _ = False

-- | How often a behaviour that always fails is tried; it faults at the thousandth try.
counting :: (Behavior () -> Behavior ()) -> IO (Ending (), Int)
counting trying = do
  count <- newTVarIO 0
  end <- ending . trying $ do
    n <- atomically (modifyTVar' count (+ 1) >> readTVar count)
    when (n == 1000) (throwIO enough)
    failed
  (,) end <$> readTVarIO count

enough :: Fault
enough = Fault "enough"
