module Viewer.RecordingSpec (spec) where

import Control.Exception (evaluate)
import qualified Data.IntSet as IntSet
import System.Timeout (timeout)
import Test.Hspec
import Test.QuickCheck

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Recording
import Viewer.Examples
import Viewer.Generate

spec :: Spec
spec = do
  it "has each span once, with what is in it" . property $ \(Related events) ->
    let numbers = map (spanNumber . nodeSpan) (nodes (recording events))
    in conjoin
        [ IntSet.size (IntSet.fromList numbers) === length numbers
        , conjoin
            [ spanParent (nodeSpan inner) === Inside (spanNumber (nodeSpan n))
            | n <- nodes (recording events)
            , inner <- nodeChildren n
            ]
        ]
  describe "of a span that is its own ancestor" $ do
    it "has it in no other one" $
      map (spanNumber . nodeSpan) (recordingRoots (recording (circle Named))) `shouldBe` [1, 2]
    -- (Span 2 is in 4, 4 in 3, 3 in 2; and 5, which has a name, is in 4.)
    it "ends, also through operators" $
      ending (withoutOperators (circle Operator ++ driving)) `shouldReturn` [inside 4]
    it "ends, also of an operator that is in itself" $
      ending (withoutOperators (Began (Span 4 (Inside 4) Operator "x" 0 Nothing) : driving)) `shouldReturn` [inside 4]
    it "ends, also of a reaction in it" $
      ending (withoutOperators (circle Branch ++ [Reacted (Reaction 6 (Inside 3) "x" 0 [] Nothing Nothing)]))
        `shouldReturn` [inside 4]
    it "ends, whatever the events are" . property $ \(Related events) ->
      ioProperty (True <$ ending (withoutOperators events))
  it "has no overflow of the number of lost events" $
    recordingLost (recording [Lost maxBound, Lost 1, Lost (-5)]) `shouldBe` maxBound
  it "has times also if one is no number" $
    let Recording {recordingFrom = begin} =
          recording (ended 1 Top "a" (0 / 0) Nothing 3 Succeeded ++ ended 2 Top "b" 1 Nothing (0 / 0) Succeeded)
    in begin `shouldBe` (1 :: Seconds)
 where
  circle kind =
    [Began (Span n (Inside p) kind "x" 0 Nothing) | (n, p) <- [(2, 4), (3, 2), (4, 3)]]
      ++ [Began (Span 1 Top Named "y" 0 Nothing) | kind == Named]
  driving = [Began (Span 5 (Inside 4) Named "drive" 0 Nothing)]
  inside = Just . Inside
  ending events =
    timeout 10000000 (evaluate (length (show events)))
      >>= maybe (fail "it does not end") (const (pure (map parent events)))
  parent event = case event of
    Began s -> Just (spanParent s)
    Ended s _ _ -> Just (spanParent s)
    Reacted r -> Just (reactionParent r)
    Lost _ -> Nothing
