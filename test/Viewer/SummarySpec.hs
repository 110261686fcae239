module Viewer.SummarySpec (spec) where

import Control.Exception (evaluate)
import Data.List (isInfixOf)
import System.Mem (getAllocationCounter, setAllocationCounter)
import Test.Hspec
import Test.QuickCheck

import Behavior.Trace
import Behavior.Trace.Diff (difference, renderDifference)
import Behavior.Trace.Path
import Behavior.Trace.Recording
import Behavior.Trace.Summary
import Behavior.Trace.Tree (renderTree)
import Viewer.Examples
import Viewer.Generate
import Viewer.Golden

spec :: Spec
spec = do
  describe "of a mission" (goldenText "mission-summary.txt" (text mission))
  describe "with all kinds of events" (goldenText "detailed-summary.txt" (text detailed))
  describe "of no events" (goldenText "empty-summary.txt" (text []))
  it "has the number of runs, their total, median and maximum, and their outcomes" $
    timesOfPath ["mission", "survey"] (summaryTimes (summary (recording mission)))
      `shouldSatisfy` maybe False isSurvey
  it "counts each named span once" . property $ \(Related events) ->
    let r = recording events
    in sum (map (timesRuns . snd) (summaryTimes (summary r)))
        === length [n | n <- nodes r, spanKind (nodeSpan n) == Named]
  it "has all outcomes of a path" . property $ \(Related events) ->
    conjoin [sum (map snd (timesOutcomes t)) === timesRuns t | (_, t) <- summaryTimes (summary (recording events))]
  it "leaves operators and branches out of paths" $
    map fst (summaryTimes (summary (recording detailed))) `shouldContain` [pathOf ["patrol", "grip"]]
  it "has the largest total first" . property $ \(Related events) ->
    let totals = map (timesTotal . snd) (summaryTimes (summary (recording events)))
    in and (zipWith (>=) totals (drop 1 totals))
  it "counts a run that has not ended until the end of the recording" $
    timesOfPath ["radio"] (summaryTimes (summary (recording mission)))
      `shouldBe` Just (Times 1 10 10 10 [("not ended", 1)])
  it "counts an interruption by the signal that the operator watches" $
    summaryInterruptions (summary (recording mission)) `shouldBe` [("batteryLow", Interruptions 1 0.3)]
  it "counts an interruption whose reaction was lost" $
    summaryInterruptions (summary (recording [e | e <- mission, not (isReaction e)]))
      `shouldBe` [("batteryLow", Interruptions 1 0)]
  it "counts no interruption where an operator was waiting" $
    summaryInterruptions (summary (recording (take 2 detailed))) `shouldBe` []
  it "has each failure with its path, and how many times there was one" $
    let failed n = ended n Top "try" (fromIntegral n) Nothing (fromIntegral n + 1) (FailedWith "no")
    in summaryFailures (summary (recording (mission ++ failed 41 ++ failed 42)))
      `shouldBe` [ (pathOf ["try"], "failed: no", 2)
                 , (pathOf ["mission", "enter room", "front door"], "failed: locked", 1)
                 , (pathOf ["mission", "survey", "photograph the north wall"], "faulted: camera: no such device", 1)
                 ]
  it "has each failure and fault of a span with a name" . property $ \(Related events) ->
    let r = recording events
        howMany =
          length
            [() | n <- nodes r, spanKind (nodeSpan n) == Named, Just (_, end) <- [nodeEnd n], isFailure end]
    in sum [n | (_, _, n) <- summaryFailures (summary r)] === howMany
  it "reports lost events" . property $ \(Related events) (Positive n) ->
    let r = recording (Lost n : events)
    in conjoin
        [ summaryLost (summary r) === sum [m | Lost m <- Lost n : events]
        , property ("lost: what is shown is incomplete" `isInfixOf` renderSummary (summary r))
        ]
  it "says nothing of lost events when there are none" $
    renderSummary (summary (recording mended)) `shouldSatisfy` not . isInfixOf "lost"
  describe "of four times as many runs of one name takes about four times as much work (if not 16 times)" $ do
    let work render = [allocatedBy (render (runsOfOneName n)) | n <- [5000, 20000]]
        shouldGrowLikeIt measured = do
          [less, more] <- sequence measured
          more `shouldSatisfy` (< 8 * less)
    it "the summary" $ shouldGrowLikeIt (work (renderSummary . summary))
    it "the differences" $ shouldGrowLikeIt (work (\r -> renderDifference (difference r r)))
    it "the tree" $ shouldGrowLikeIt (work renderTree)
  it "is made of ten thousand spans in each other" $
    let deep = concat [ended n (Inside (n - 1)) "deeper" 0 Nothing 1 Succeeded | n <- [1 .. 10000]]
    in length (renderSummary (summary (recording deep)))
      `shouldSatisfy` (> 10000)
 where
  text = renderSummary . summary . recording
  timesOfPath names found = lookup (innermostFirst (pathOf names)) [(innermostFirst p, t) | (p, t) <- found]
  isSurvey t =
    timesRuns t == 2
      && near (timesTotal t) 11.9
      && near (timesMedian t) 3.4
      && near (timesLongest t) 8.5
      && timesOutcomes t == [("stopped", 1), ("succeeded", 1)]
  runsOfOneName n =
    recording (concat [ended k Top "again" (fromIntegral k) Nothing (fromIntegral k + 1) Succeeded | k <- [1 .. n]])
  -- Bytes, in this thread.
  allocatedBy made = do
    setAllocationCounter 0
    _ <- evaluate (length made)
    negate <$> getAllocationCounter
  near a b = abs (a - b) < 1e-9
  isReaction (Reacted _) = True
  isReaction _ = False
  isFailure (FailedWith _) = True
  isFailure (FaultedWith _) = True
  isFailure _ = False
