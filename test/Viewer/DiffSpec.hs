module Viewer.DiffSpec (spec) where

import Data.List (isInfixOf)
import Test.Hspec
import Test.QuickCheck

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Diff
import Behavior.Trace.File (relativeTo)
import Behavior.Trace.Path (pathOf)
import Behavior.Trace.Recording
import Viewer.Examples
import Viewer.Generate
import Viewer.Golden

spec :: Spec
spec = do
  describe "of two missions" (goldenText "mission-diff.txt" (renderDifference (between mission mended)))
  it "are none between a trace and itself" . property $ \(Related events) ->
    let d = between events events in (firstDivergence d, timesByPath d) === (Nothing, [])
  it "are none between two traces with another zero" . property $ \(Related events) zero ->
    let d = between events (map (relativeTo (fromIntegral (zero :: Int))) events)
    in (firstDivergence d, timesByPath d) === (Nothing, [])
  it "diverge first where the earliest one is" $
    firstDivergence (between mission mended)
      `shouldBe` Just (Divergence 2.4 (pathOf ["mission", "enter room", "front door"]) 1 "failed: locked" "succeeded")
  it "diverge where a failure began, not where it arrived" $
    (divergedPath <$> firstDivergence (between (inEachOther (FailedWith "x")) (inEachOther Succeeded)))
      `shouldBe` Just (pathOf ["a", "b"])
  it "diverge where one did not run" $
    firstDivergence (between (one "a" 0 1 ++ one "b" 1 2) (one "a" 0 1))
      `shouldBe` Just (Divergence 1 (pathOf ["b"]) 1 "succeeded" "did not run")
  it "diverge where two ran in the opposite order" $
    firstDivergence (between (one "a" 0 1 ++ one "b" 1 2) (one "b" 0 1 ++ one "a" 1 2))
      `shouldBe` Just (Divergence 0 (pathOf ["a"]) 1 "ran before \"b\"" "ran after \"b\"")
  it "do not include the order of branches that run at the same time" $
    firstDivergence (between (one "a" 0 3 ++ one "b" 1 4) (one "b" 0 3 ++ one "a" 1 4)) `shouldBe` Nothing
  it "do not include the values of signals, which are never the same twice" $
    firstDivergence (between (stopped "9.4") (stopped "9.3")) `shouldBe` Nothing
  it "do not include how long something had run that was stopped" $
    firstDivergence (between (stoppedAt 60 3) (stoppedAt 50 5)) `shouldBe` Nothing
  it "have the path with the largest difference of the totals first" . property $ \(Related a) (Related b) ->
    let sizes = [abs (sideTotal x - sideTotal y) | (_, x, y) <- timesByPath (between a b)]
    in and (zipWith (>=) sizes (drop 1 sizes))
  it "are the same the other way round" . property $ \(Related a) (Related b) ->
    [(p, y, x) | (p, x, y) <- timesByPath (between a b)] === timesByPath (between b a)
  it "are found in ten thousand spans in each other" $
    length (renderDifference (between (deep 1) (deep 2))) `shouldSatisfy` (> 10000)
  it "report what was lost on each side" $ do
    renderDifference (between (Lost 2 : mended) mended) `shouldSatisfy` ("First: 2 events were lost" `isInfixOf`)
    renderDifference (between mended (Lost 1 : mended)) `shouldSatisfy` ("Second: 1 event was lost" `isInfixOf`)
    renderDifference (between mended mended) `shouldSatisfy` not . isInfixOf "lost"
 where
  between a b = difference (recording a) (recording b)
  deep end = concat [ended n (Inside (n - 1)) "deeper" 0 Nothing end Succeeded | n <- [1 .. 10000]]
  inEachOther end = ended 2 (Inside 1) "b" 0 Nothing 1 end ++ ended 1 Top "a" 0 Nothing 1 end
  stopped value = ended 1 Top "a" 0 Nothing 1 (StoppedBy (SignalChanged 2 [Change "battery" Nothing value]))
  stoppedAt t took =
    ended 1 Top "a" 0 Nothing t (StoppedBy (SignalChanged 3 []))
      ++ ended 2 Top "b" (t - took) Nothing t (StoppedBy (SignalChanged 3 []))
      ++ [Reacted (Reaction 3 Top "monitor" t [] (Just (StoppedBranch "task" t 0 Succeeded)) Nothing)]

one :: String -> Seconds -> Seconds -> [Event]
one name begin end = ended (round begin + 1) Top name begin Nothing end Succeeded
