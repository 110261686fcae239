-- | What someone reads from a timeline who has not seen the program.
module Viewer.PictureSpec (spec) where

import Data.Char (isDigit)
import Data.List (isInfixOf, isPrefixOf, stripPrefix, tails)
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
      [t | t <- texts (drawn (long 1000)), "the longest:" `isInfixOf` t, name <- ["look:", "open door:", "photograph:"], (name ++ "114 s (11 %, 143 times)") `isInfixOf` t]
        `shouldSatisfy` ((== 3) . length)
    it "with the time once in which a name ran twice" $
      whereMost (concat [ended k Top "arm" 0 Nothing 6 Succeeded | k <- [1, 2]] ++ ended 3 Top "wait" 6 Nothing 10 Succeeded)
        `shouldBe` "arm:6 s (60 %, twice),wait:4 s (40 %)"
    it "with how many others there are" $
      whereMost (legs 10 ++ ended 11 Top "home" 11 Nothing 15 Succeeded)
        `shouldBe` "home:4 s (29 %),leg 1:1 s (7 %),leg 10:1 s (7 %),leg 2:1 s (7 %)and 7 others"
    it "with other words, if no name took a fifth of it" $
      [t | t <- texts (drawn (legs 10)), "leg 1:" `isInfixOf` t]
        `shouldBe` ["spread over 10 parts, the longest:leg 1:1 s (10 %),leg 10:1 s (10 %),leg 2:1 s (10 %),leg 3:1 s (10 %)and 6 others"]
    it "if nothing took time" $ whereMost (ended 1 Top "a" 1 Nothing 1 Succeeded) `shouldBe` "nothing took time"
    it "with shares of the whole" . property $ forAllBlind likelyEvents $ \events ->
      let shares = [read (reverse (takeWhile isDigit (reverse known))) :: Int | (known, rest) <- splits (whereMost (map renamed events)), " %" `isPrefixOf` rest]
       in counterexample (show shares) (length shares <= 4 && all (<= 100) shares)

  describe "explains" $ do
    it "the marks that it contains" $ do
      legend watering `shouldBe` ["succeeded", "stopped", "a signal changed → stopped → started", "a signal changed → started"]
      legend mission
        `shouldBe` ["succeeded", "failed", "faulted", "stopped", "while stopping", "not ended", "a signal changed → stopped → started", "a signal changed → started"]
      legend (mixed 10000) `shouldBe` ["succeeded", "failed", "faulted", "stopped", "short spans, together"]
    it "no others" $ do
      legend (ended 1 Top "a" 0 Nothing 1 Succeeded) `shouldBe` ["succeeded"]
      legend (interrupted 3) `shouldBe` ["stopped", "while stopping", "a signal changed → stopped → started"]
      legend [] `shouldBe` []

  describe "has another mark for a change that interrupted nothing" $ do
    it "than for one that interrupted something" $
      [(attribute "class" e, take 10 (textOf e)) | e <- allOf "path" (drawn watering), attribute "class" e `elem` ["i", "io"], not (null (textOf e))]
        `shouldBe` [("i", "battery 18"), ("io", "battery 10")]
    it "and says what starts, if need be without the values before" $
      texts (drawn watering) `shouldSatisfy` elem "battery 100 → batteryLow False→ starts \"water\""

  describe "shows texts whole, if there is room" $ do
    it "a failure on two lines" $
      texts (drawn doors) `shouldSatisfy` (\known -> all (`elem` known) ["failed: the front", "door is locked"])
    it "a failure that reaches below the next bar" $
      texts (drawn (locked ++ ended 8 (Inside 1) "rest" 2 Nothing 10 Succeeded)) `shouldSatisfy` elem "failed: the back door is locked"
    it "a name on two lines" $
      texts (drawn doors) `shouldSatisfy` (\known -> all (`elem` known) ["front door", "smash", "back door"])
    it "and nothing of them is cut off" $
      [t | t <- texts (drawn doors), '…' `elem` t] `shouldBe` []
    it "a lane is higher, if texts below it have two lines" $
      attributeOf "height" (drawn doors) - attributeOf "height" (drawn (map withoutReason doors)) `shouldBe` 13

  it "has a line to each text that is outside of its bar" $ do
    let events = ended 1 Top "mission" 0 Nothing 100 Succeeded ++ ended 2 (Inside 1) "photograph" 50 Nothing 51 Succeeded
        ends = [d | e <- allOf "path" (drawn events), attribute "class" e == "ld", let d = attribute "d" e]
        left = [x | t <- allOf "text" (drawn events), "photograph" `isPrefixOf` textOf t, x <- [attributeOf "x" t]]
    length ends `shouldBe` 1
    -- From 51 % of the width to the text.
    (takeWhile (/= ' ') (drop 1 (head ends)), reverse (takeWhile (/= 'H') (reverse (head ends)))) `shouldBe` ("611.4", "622.4")
    left `shouldBe` [625.4]

drawn :: [Event] -> Xml
drawn events = either error id (readXml (Lazy.unpack (timeline (recording events))))

allOf :: String -> Xml -> [Xml]
allOf name x = [e | e@(Element name' _ _) <- everything x, name' == name]

texts :: Xml -> [String]
texts = map textOf . allOf "text"

title :: [Event] -> String
title events = head [textOf t | t <- allOf "text" (drawn events), attribute "class" t == "t"]

-- One after the other, a second each.
legs :: Int -> [Event]
legs n = concat [ended k Top ("leg " ++ show k) (fromIntegral k) Nothing (fromIntegral k + 1) Succeeded | k <- [1 .. n]]

whereMost :: [Event] -> String
whereMost events = head [rest | t <- texts (drawn events), begin <- ["most of the time:", "the longest:"], Just rest <- map (stripPrefix begin) (tails t)]

legend :: [Event] -> [String]
legend events = [textOf t | g <- allOf "g" (drawn events), attribute "class" g == "le", t <- allOf "text" g]

attributeOf :: String -> Xml -> Double
attributeOf name x = read (if '.' `elem` text then text else text ++ ".0")
 where
  text = attribute name x

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

withoutReason :: Event -> Event
withoutReason event = case event of
  Ended s t (FailedWith _) -> Ended s t (FailedWith "")
  _ -> event

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

-- Doors are locked; the robot is interrupted when it smashes one.
doors :: [Event]
doors =
  locked
    ++ ended 4 (Inside 1) "smash back door" 2 Nothing 2.55 (StoppedBy low)
    ++ [Reacted (Reaction 5 (Inside 1) "monitor" 2.55 changes (Just (StoppedBranch "task" 2.55 0 (StoppedBy low))) (Just "recovery"))]
    ++ ended 6 (Inside 1) "recharge" 2.55 (Just 5) 4.5 Succeeded
 where
  low = SignalChanged 5 changes
  changes = [Change "battery" (Just "10") "9"]

locked :: [Event]
locked =
  ended 1 Top "mission" 0 Nothing 10 Succeeded
    ++ ended 2 (Inside 1) "open front door" 0 Nothing 1 (FailedWith "the front door is locked")
    ++ ended 3 (Inside 1) "open back door" 1 Nothing 2 (FailedWith "the back door is locked")
