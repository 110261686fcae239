-- |
-- Section 3.1 of the paper: the progress problem of ticked trees.
module Examples.ProgressProblemSpec (spec) where

import Test.Hspec
import Test.QuickCheck

import Support (Ending (..), ending)
import qualified Tick

spec :: Spec
spec = do
  it "a ticked Sequence of two actions that take time never finishes" $
    property $ \(Positive n) (Positive m) ->
      runs 200 n m (\clock one two -> Tick.ticked clock (Tick.sequenceOf [one, two]))
        `shouldReturn` FailedWith "FailedBecause \"not done after 200 ticks\""

  it "a ticked Sequence with memory takes as many ticks as its actions" $
    property $ \(Positive n) (Positive m) ->
      runs (n + m + 1) n m (\clock one two -> Tick.sequenceWithMemory [one, two] >>= Tick.ticked clock)
        `shouldReturn` Gave ()

  it "in this language it takes as many ticks as its actions" $
    property $ \(Positive n) (Positive m) ->
      runs (n + m + 1) n m (\clock one two -> Tick.ticked clock one >> Tick.ticked clock two)
        `shouldReturn` Gave ()

-- | Runs a composition of two actions, with a limit of ticks. The other numbers are the ticks
-- that each action takes.
runs :: Int -> Int -> Int -> (Tick.Clock -> Tick.Node -> Tick.Node -> IO ()) -> IO (Ending ())
runs limit n m composition = do
  clock <- Tick.newClock limit
  one <- Tick.action clock "one" n
  two <- Tick.action clock "two" m
  ending (composition clock one two)
