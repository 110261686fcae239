module Viewer.PlainLinesSpec (spec) where

import Test.Hspec
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck

import Behavior.Internal.Tracing.Text
import Behavior.Trace
import Viewer.Examples
import Viewer.Generate
import Viewer.Golden

spec :: Spec
spec = do
  goldenText "mission-lines.txt" (unlines (map plainLine mission))

  it "has the cause of an interruption with its values, what was stopped, and what starts" $
    map plainLine (filter isReaction mission)
      `shouldBe` [ "9.100 ! battery 9.4 (was 100) -> batteryLow True (was False) \
                   \-> stopped its task after 3.1 s (took 0.3 s) -> recovery"
                 , "28.000 ! batteryLow False (was True) -> starts task"
                 ]

  it "says how a branch ended that was to be stopped" $ do
    let line end = plainLine (Reacted (Reaction 2 Top "monitor" 1 [] (Just (StoppedBranch "a" 1 0.5 end)) Nothing))
    line Succeeded
      `shouldBe` "1.000 ! monitor changed -> stopped its a after 1 s (took 0.5 s, it completed nevertheless)"
    line (FaultedWith "arm")
      `shouldBe` "1.000 ! monitor changed -> stopped its a after 1 s (took 0.5 s, it faulted: arm)"

  it "says each cause of a stop" $ do
    let line cause = plainLine (Ended (Span 1 Top Named "a" 0 Nothing) 2 (StoppedBy cause))
    map line [SiblingFinished "b", SiblingFailed "b", TimeLimit 2, FromOutside "UserInterrupt", WasAbandoned]
      `shouldBe` map
        ("2.000 - a: stopped after 2 s: " ++)
        [ "\"b\" finished"
        , "\"b\" failed"
        , "time limit of 2 s"
        , "cancelled from outside: UserInterrupt"
        , "abandoned, it may still run"
        ]

  it "is one line of at most a few thousand characters, whatever the texts" $
    map plainLine oddEvents `shouldSatisfy` all (\line -> '\n' `notElem` line && length line < 8000)

  prop "contains nothing that a terminal obeys" $
    forAllBlind likelyEvents $ \events ->
      let text = concatMap plainLine events
       in counterexample (show text) (all isHarmless text)

  prop "shows durations with three digits that count" $ \(Positive d) ->
    let t = d :: Double
     in t < 1e-6 || t > 1e9 || abs (read (takeWhile (/= ' ') (secondsText (realToFrac t))) - t) <= 0.005 * t
 where
  isReaction (Reacted _) = True
  isReaction _ = False
