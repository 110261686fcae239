-- | What someone reads from a timeline who has not seen the program.
module Viewer.PictureSpec (spec) where

import Data.Char (isDigit)
import Data.List (isInfixOf, isPrefixOf)
import qualified Data.Text.Lazy as Lazy
import Test.Hspec
import Test.QuickCheck

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Recording
import Behavior.Trace.Svg
import Viewer.Examples
import Viewer.Generate
import Viewer.Xml

spec :: Spec
spec = do
  describe "says how it ended" $ do
    it "with its time, interruptions, and what did not succeed" $ do
      title watering `shouldBe` "mission succeeded after 37.5 s:interrupted once"
      title mission `shouldBe` "mission not ended after 40 s:interrupted once, 1 of its 10 parts failed, 1 faulted, 2 not ended2 events were lost"
      title (ended 1 Top "drive" 2 Nothing 4 (FailedWith "stuck")) `shouldBe` "drive failed after 2 s"
      title (ended 1 Top "drive" 2 Nothing 4 (StoppedBy (TimeLimit 2))) `shouldBe` "drive was stopped after 2 s"
    it "of several spans that are in no other" $
      title (failing 3) `shouldBe` "2.9 s in all:3 of 3 parts failed"
    it "where changes interrupted nothing" $
      title [e | e <- watering, not (isInterruption e)] `shouldBe` "mission succeeded after 37.5 s"

  describe "says where most of the time went" $ do
    it "at the level where it is divided" $
      whereMost watering `shouldBe` "water:29.5 s (79 %, twice),recharge:8 s (21 %)"
    it "with what one name leaves of it to no other" $
      whereMost (ended 1 Top "mission" 0 Nothing 40 Succeeded ++ ended 2 (Inside 1) "bed 4" 0 Nothing 7 Succeeded)
        `shouldBe` "mission itself:33 s (82 %),bed 4:7 s (18 %)"
    it "with the names inside, if there are many that took little" $
      [t | t <- texts (drawn (long 1000)), "most of" `isPrefixOf` t, name <- ["look:", "open door:", "photograph:"], (name ++ "114 s (11 %, 143 times)") `isInfixOf` t]
        `shouldSatisfy` ((== 3) . length)
    it "with the time once in which a name ran twice" $
      whereMost (concat [ended k Top "arm" 0 Nothing 6 Succeeded | k <- [1, 2]] ++ ended 3 Top "wait" 6 Nothing 10 Succeeded)
        `shouldBe` "arm:6 s (60 %, twice),wait:4 s (40 %)"
    it "if nothing took time" $ whereMost (ended 1 Top "a" 1 Nothing 1 Succeeded) `shouldBe` "nothing took time"
    it "with shares of the whole" . property $ forAllBlind likelyEvents $ \events ->
      let shares = [read (reverse (takeWhile isDigit (reverse known))) :: Int | (known, rest) <- splits (whereMost (map renamed events)), " %" `isPrefixOf` rest]
       in counterexample (show shares) (length shares <= 4 && all (<= 100) shares)

drawn :: [Event] -> Xml
drawn events = either error id (readXml (Lazy.unpack (timeline (recording events))))

allOf :: String -> Xml -> [Xml]
allOf name x = [e | e@(Element name' _ _) <- everything x, name' == name]

texts :: Xml -> [String]
texts = map textOf . allOf "text"

title :: [Event] -> String
title events = head [textOf t | t <- allOf "text" (drawn events), attribute "class" t == "t"]

whereMost :: [Event] -> String
whereMost events = head [drop (length begin) t | t <- texts (drawn events), begin `isPrefixOf` t]
 where
  begin = "most of the time:"

splits :: String -> [(String, String)]
splits text = [splitAt k text | k <- [0 .. length text]]

-- So that many spans have the same name.
renamed :: Event -> Event
renamed event = case event of
  Began s -> Began (short s)
  Ended s t end -> Ended (short s) t end
  _ -> event
 where
  short s = s {spanName = ["ab" !! (spanNumber s `mod` 2)]}

isInterruption :: Event -> Bool
isInterruption event = case event of
  Reacted Reaction {reactionStopped = Just _} -> True
  _ -> False

-- Beds are watered; the robot recharges, and goes on.
watering :: [Event]
watering =
  ended 1 Top "mission" 0 Nothing 37.5 Succeeded
    ++ ended 2 (Inside 1) "water" 0 Nothing 16 (StoppedBy low)
    ++ concat [bed (2 + k) 2 k (4.5 * fromIntegral (k - 1)) | k <- [1 .. 3]]
    ++ ended 6 (Inside 2) "water bed 4" 13.5 Nothing 16 (StoppedBy low)
    ++ [Reacted (Reaction 7 (Inside 1) "monitor" 16 changes (Just (StoppedBranch "task" 16 0 (StoppedBy low))) (Just "recovery"))]
    ++ ended 8 (Inside 1) "recharge" 16 (Just 7) 24 Succeeded
    ++ [Reacted (Reaction 9 (Inside 1) "monitor" 24 [Change "battery" (Just "18") "100", Change "batteryLow" (Just "True") "False"] Nothing (Just "task"))]
    ++ ended 10 (Inside 1) "water" 24 (Just 9) 37.5 Succeeded
    ++ concat [bed (7 + k) 10 k (24 + 4.5 * fromIntegral (k - 4)) | k <- [4 .. 6]]
 where
  low = SignalChanged 7 changes
  changes = [Change "battery" (Just "50") "18", Change "batteryLow" (Just "False") "True"]
  bed :: Int -> Int -> Int -> Seconds -> [Event]
  bed n parent k begin = ended n (Inside parent) ("water bed " ++ show k) begin Nothing (begin + 4.5) Succeeded
