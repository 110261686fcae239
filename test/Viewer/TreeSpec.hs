module Viewer.TreeSpec (spec) where

import Data.Foldable (for_)
import Data.List (isInfixOf)
import Data.Maybe (isNothing)
import Test.Hspec
import Test.QuickCheck

import Behavior.Trace
import Behavior.Trace.Recording
import Behavior.Trace.Tree
import Viewer.Examples
import Viewer.Generate
import Viewer.Golden
import Viewer.Missions (beside, untilButton)

spec :: Spec
spec = do
  describe "of a mission" (goldenText "mission-tree.txt" (tree mission))
  describe "with all kinds of events" (goldenText "detailed-tree.txt" (tree detailed))
  it "has a line for each span and each reaction, and one for what was lost" . property $ \(Related events) ->
    let r = recording events
    in length (lines (renderTree r))
        === 1 + length (nodes r) + length (recordingReactions r) + (if recordingLost r == 0 then 0 else 1)
  it "names the part that finished, so that others were stopped" $
    renderTree (recording (beside 5)) `shouldSatisfy` ("listen: stopped: \"look\" finished" `isInfixOf`)
  it "names the signal that was awaited beside what was stopped" $ do
    let change = [Change "red button" (Just "False") "True"]
        shown = renderTree (recording (untilButton 0 [Reaction 3 (Inside 1) "waitUntil" 20 change Nothing Nothing]))
    for_ ["patrol", "gate"] $ \name ->
      shown `shouldSatisfy` ((name ++ ": stopped: red button True (was False)") `isInfixOf`)
    shown `shouldSatisfy` ("whistle: stopped: the left branch finished" `isInfixOf`)
    shown `shouldSatisfy` ("! red button True (was False) -> stopped \"patrol\" after 20 s" `isInfixOf`)
  it "reports lost events also when it has nothing else" $
    renderTree (recording [Lost 2]) `shouldSatisfy` ("2 events were lost" `isInfixOf`)
  it "is that of the events in any order" . property $ \(Related events) ->
    -- (Of damaged traces, which repeat numbers, only the last event with each number counts.)
    let each = distinct events
    in forAll (shuffle each) $ \other -> renderTree (recording other) === renderTree (recording each)
 where
  tree = renderTree . recording
  distinct events =
    [ e
    | (i, e) <- numbered events
    , all (\(j, f) -> j >= i || number e /= number f || isNothing (number e)) (numbered events)
    ]
  numbered = zip [0 :: Int ..]
  number event = case event of
    Began s -> Just (spanNumber s)
    Ended s _ _ -> Just (spanNumber s)
    Reacted r -> Just (reactionNumber r)
    Lost _ -> Nothing
