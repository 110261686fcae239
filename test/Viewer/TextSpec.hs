module Viewer.TextSpec (spec) where

import qualified Data.Text.Lazy as Text
import qualified Data.Text.Lazy.Encoding as Text
import Test.Hspec
import Test.QuickCheck

import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Diff
import Behavior.Trace.Otlp
import Behavior.Trace.Recording
import Behavior.Trace.Summary
import Behavior.Trace.TraceEvents
import Behavior.Trace.Tree
import Viewer.Examples
import Viewer.Generate
import Viewer.Golden

spec :: Spec
spec = do
  describe "have no effect on a terminal" $ do
    it "in the tree" (harmless renderTree)
    it "in the summary" (harmless (renderSummary . summary))
    it "in the differences" . property $ \(AnyEvents a) (AnyEvents b) ->
      inertLines (renderDifference (difference (recording (oddOnes ++ a)) (recording b)))
    it "in the trace-event format, and none on a web page" . property $ \(AnyEvents events) ->
      let made = Text.unpack (Text.decodeUtf8 (renderTraceEvents (recording (oddOnes ++ events))))
      in conjoin [inertLines made, filter (`elem` "<&") made === ""]
    it "in OTLP, and none on a web page" . property $ \(AnyEvents events) ->
      let made = otlp (oddOnes ++ events)
      in conjoin [inertLines made, filter (`elem` "<>&") made === ""]
    it "in a word" $ forAll oddText (inertLines . inert)
  describe "a tree of odd texts" (goldenText "odd-tree.txt" (renderTree (recording oddOnes)))
  describe "a summary of odd texts" (goldenText "odd-summary.txt" (renderSummary (summary (recording oddOnes))))
  it "of a megabyte are shortened, with a remark" $ do
    let huge = replicate 1048576 'x'
        events =
          ended 1 Top huge 0 Nothing 1 (FailedWith huge)
            ++ ended 2 Top huge 0 Nothing 1 (StoppedBy (SignalChanged 3 [Change huge Nothing huge]))
            ++ [Reacted (Reaction 3 Top huge 0.5 [Change huge (Just huge) huge] (Just stopped) (Just huge))]
        stopped = StoppedBranch huge 0.5 0.5 Succeeded
        made =
          [ renderTree (recording events)
          , renderSummary (summary (recording events))
          , renderDifference (difference (recording events) (recording []))
          , Text.unpack (Text.decodeUtf8 (renderTraceEvents (recording events)))
          , otlp events
          ]
    map ((< 10000) . length) made `shouldBe` map (const True) made
    map ('…' `elem`) made `shouldBe` map (const True) made
 where
  otlp = Text.unpack . Text.decodeUtf8 . renderOtlp "Ann" header . recording
  harmless render = property $ \(AnyEvents events) -> inertLines (render (recording (oddOnes ++ events)))
  inertLines text = filter (\c -> c /= '\n' && not (isHarmless c)) text === ""
  oddOnes = textInAllPlaces oddTexts
