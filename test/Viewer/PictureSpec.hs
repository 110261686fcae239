-- | What someone reads from a timeline who has not seen the program.
module Viewer.PictureSpec (spec) where

import Data.Char (isDigit)
import Data.List (isInfixOf, isPrefixOf, sort, stripPrefix, tails)
import qualified Data.Text.Lazy as Lazy
import Test.Hspec
import Test.QuickCheck

import Behavior.Trace
import Behavior.Trace.Recording
import Behavior.Trace.Svg
import Viewer.Examples
import Viewer.Generate
import Viewer.Missions
import Viewer.Shapes
import Viewer.Xml

spec :: Spec
spec = do
  describe "says how it ended" $ do
    it "with its time, interruptions, and what did not succeed" $ do
      title watering `shouldBe` "mission succeeded after 37.5 s:interrupted once, 2.5 s of work redone"
      title mission
        `shouldBe` "mission not ended after 40 s:interrupted once, 1 of 10 parts failed, 1 faulted, 2 not ended, \
                   \2.4 s of work redone2 events were lost"
      title (ended 1 Top "drive" 2 Nothing 4 (FailedWith "stuck")) `shouldBe` "drive failed after 2 s"
      title (ended 1 Top "drive" 2 Nothing 4 (StoppedBy (TimeLimit 2))) `shouldBe` "drive was stopped after 2 s"
    it "by a signal that ended it" $ do
      title buttoned `shouldBe` "mission was ended by red button True after 7 s:interrupted once"
      -- Not if something began after that, or went on.
      title (buttoned ++ ended 9 (Inside 1) "motors off" 6.5 Nothing 7 Succeeded)
        `shouldBe` "mission succeeded after 7 s:interrupted once"
      title (buttoned ++ ended 9 (Inside 1) "film" 2 Nothing 6.8 Succeeded)
        `shouldBe` "mission succeeded after 7 s:interrupted once"
    it "by a signal and what ran because of that" $ do
      title emergency `shouldBe` "mission was ended by red button True → \"motors off\" after 7 s:interrupted once"
      -- Not if the operator could go back, or if something else began after that.
      title (map (byOperator "switch") emergency) `shouldBe` "mission succeeded after 7 s:interrupted once"
      title (emergency ++ ended 9 (Inside 1) "report" 6.5 Nothing 7 Succeeded)
        `shouldBe` "mission succeeded after 7 s:interrupted once"
    it "at a part that a signal ended" $ do
      title surveyed `shouldBe` "mission succeeded after 9 s:interrupted once"
      [t | t <- texts (drawn surveyed), "ended by a signal" `isInfixOf` t]
        `shouldBe` ["ended by a signal", "survey7 s, ended by a signal"]
      -- The mission too, if nothing follows.
      title [e | e <- surveyed, notBed "fly home" e]
        `shouldBe` "mission was ended by strong wind True → \"go down\" after 9 s:interrupted once"
    it "without interruptions that ended a wait" $ do
      title (ruled 0) `shouldBe` "mission succeeded after 20 s:interrupted once, 6 s of work redone"
      [ attribute "class" e
        | e <- allOf "path" (drawn (ruled 0))
        , attribute "class" e `elem` ["i", "io"]
        , not (null (textOf e))
        ]
        `shouldBe` ["i", "io"]
      texts (drawn (ruled 0)) `shouldSatisfy` elem "detections 0 (was 1)→ starts \"patrol\""
      -- Not if that took time, or it is not known what ran there.
      title (ruled 1) `shouldSatisfy` isInfixOf ":interrupted twice"
      title [e | e <- ruled 0, notBed "photograph" e] `shouldSatisfy` isInfixOf ":interrupted twice"
    it "with the time of what had to begin again" $ do
      title wateredAgain `shouldBe` "mission succeeded after 30 s:10 s of work redone"
      title [e | e <- wateredAgain, notBed "bed 1" e || not (isLater e)]
        `shouldBe` "mission succeeded after 30 s:5 s of work redone"
      title (beside 5 ++ ended 4 (Inside 1) "listen" 6 Nothing 9 Succeeded) `shouldBe` "mission succeeded after 10 s"
    it "of several spans that are in no other" $
      title (failing 3) `shouldBe` "2.9 s in all:3 of 3 parts failed, 1.8 s of work redone"
    it "where changes interrupted nothing" $
      title [e | e <- watering, not (isInterruption e)] `shouldBe` "mission succeeded after 37.5 s:2.5 s of work redone"

  describe "says where the time went" $ do
    it "at the level where it is divided" $
      whereMost watering `shouldBe` "water:29.5 s (79 %, twice),recharge:8 s (21 %)"
    it "with what has no name" $
      whereMost (ended 1 Top "mission" 0 Nothing 40 Succeeded ++ ended 2 (Inside 1) "bed 4" 0 Nothing 7 Succeeded)
        `shouldBe` "waiting or unnamed:33 s (82 %),bed 4:7 s (18 %)"
    it "with the names inside, if there are many that took little" $
      [ t
        | t <- texts (drawn (long 1000))
        , "the longest:" `isInfixOf` t
        , name <- ["look:", "open door:", "photograph:"]
        , (name ++ "114 s (11 %, 143 times)") `isInfixOf` t
        ]
        `shouldSatisfy` ((== 3) . length)
    it "with the time once in which a name ran twice" $ do
      let both = concat [ended k Top "arm" 0 Nothing 6 Succeeded | k <- [1, 2]]
      whereMost (both ++ ended 3 Top "wait" 6 Nothing 10 Succeeded)
        `shouldBe` "arm:6 s (60 %, twice),wait:4 s (40 %)"
    it "with the names of the others" $
      whereMost (legs 9 ++ ended 11 Top "home" 10 Nothing 14 Succeeded)
        `shouldBe` "home:4 s (31 %),leg a:1 s (8 %),leg b:1 s (8 %),leg c:1 s (8 %)and leg d, leg e, leg f, leg g, \
                   \leg h, leg i"
    it "with how many others there are, if their names have no room" $
      whereMost (concat [leg k (toEnum (96 + k) : "leg in the north of the field") | k <- [1 .. 20]])
        `shouldSatisfy` isInfixOf "and 18 others"
    it "with those in a series as one" $
      whereMost (concat [leg k ("leg " ++ show k) | k <- [1 .. 10]] ++ ended 11 Top "home" 11 Nothing 15 Succeeded)
        `shouldBe` "leg 1\8211\&10:10 s (71 %, 10 times),home:4 s (29 %)"
    it "of several side by side: as the sum of their parts" $
      [t | t <- texts (drawn (robots 3)), "side by side" `isInfixOf` t]
        `shouldBe` ["3 side by side, together 18 s:drive:10.2 s (57 %),charge:6 s (33 %),waiting or unnamed:1.8 s \
                    \(10 %)"]
    it "with other words, if no name took a fifth of it" $
      [t | t <- texts (drawn (legs 10)), "leg a:" `isInfixOf` t]
        `shouldBe` ["spread over 10 parts, the longest:leg a:1 s (10 %),leg b:1 s (10 %),leg c:1 s (10 %),leg d:1 s \
                    \(10 %)and leg e, leg f, leg g, leg h, leg i, leg j"]
    it "if nothing took time" $ whereMost (ended 1 Top "a" 1 Nothing 1 Succeeded) `shouldBe` "nothing took time"
    it "with shares of the whole" . property $ forAllBlind likelyEvents $ \events ->
      let shares =
            [ read (reverse (takeWhile isDigit (reverse known))) :: Int
            | line <- texts (drawn (map renamed events))
            , any (`isInfixOf` line) ["time:", "the longest:", "side by side"]
            , (known, rest) <- splits line
            , " %" `isPrefixOf` rest
            ]
       in counterexample (show shares) (length shares <= 4 && all (<= 100) shares)

  describe "explains" $ do
    it "the marks that it contains" $ do
      legend watering
        `shouldBe` [ "succeeded"
                   , "stopped"
                   , "a signal changed → stopped"
                   , "then started"
                   , "a signal changed → started"
                   ]
      legend mission
        `shouldBe` [ "succeeded"
                   , "failed"
                   , "faulted"
                   , "stopped"
                   , "while stopping"
                   , "not ended"
                   , "waiting, or unnamed"
                   , "a signal changed → stopped"
                   , "then started"
                   , "a signal changed → started"
                   ]
      legend (mixed 10000) `shouldBe` ["succeeded", "failed", "faulted", "stopped", "short spans, together"]
    it "no others" $ do
      legend (ended 1 Top "a" 0 Nothing 1 Succeeded) `shouldBe` ["succeeded"]
      legend (interrupted 3) `shouldBe` ["stopped", "while stopping", "a signal changed → stopped", "then started"]
      legend [] `shouldBe` []

  describe "has another mark for a change that interrupted nothing" $ do
    it "than for one that interrupted something" $
      [ (attribute "class" e, take 10 (textOf e))
        | e <- allOf "path" (drawn watering)
        , attribute "class" e `elem` ["i", "io"]
        , not (null (textOf e))
        ]
        `shouldBe` [("i", "battery 18"), ("io", "battery 10")]
    it "and says what starts, if need be without the values before" $
      texts (drawn watering) `shouldSatisfy` elem "battery 100 (was 18) → batteryLow False→ starts \"water\""

  describe "shows texts whole, if there is room" $ do
    it "a failure on two lines" $
      texts (drawn doors) `shouldSatisfy` (\known -> all (`elem` known) ["failed: the front", "door is locked"])
    it "a failure that reaches below the next bar" $
      texts (drawn (locked ++ ended 8 (Inside 1) "rest" 2 Nothing 10 Succeeded))
        `shouldSatisfy` elem "failed: the back door is locked"
    it "a name on two lines" $
      texts (drawn doors) `shouldSatisfy` (\known -> all (`elem` known) ["front door", "smash", "back door"])
    it "and nothing of them is cut off" $
      [t | t <- texts (drawn doors), '…' `elem` t] `shouldBe` []
    it "a lane is higher, if texts below it have two lines" $
      attributeOf "height" (drawn doors) - attributeOf "height" (drawn (map withoutReason doors)) `shouldBe` 13

  describe "of interruptions" $ do
    it "names the value of each, of five within two seconds in a minute" $
      texts (drawn crowded)
        `shouldSatisfy` \known -> and [any (("obstacle " ++ show k) `isPrefixOf`) known | k <- [2 .. 6 :: Int]]
    it "names the first value, if there are more at a place than have room" $
      [t | t <- texts (drawn (crowdedBy 50 0.001)), "obstacle 2" `isPrefixOf` t]
        `shouldSatisfy` any ("and 49 interruptions" `isInfixOf`)
    it "leaves out what did not change" $
      texts (drawn (map (withChange (Change "outside" (Just "False") "False")) watering))
        `shouldSatisfy` \known -> any ("battery 18" `isPrefixOf`) known && not (any ("outside" `isInfixOf`) known)
    it "says equally much of each, and says it on the right of its mark if there is room" $ do
      let said events =
            [ (textOf t, attribute "class" t)
            | g <- allOf "g" (drawn events)
            , attribute "class" g == "il"
            , t <- allOf "text" g
            ]
          saidAfter apart = length [t | (t, _) <- said (crowdedBy 2 apart), " after " `isInfixOf` t]
      map saidAfter [4, 7] `shouldBe` [2, 0]
      [map snd (said (crowdedBy 1 apart)) | apart <- [0, 12]] `shouldBe` [[""], [""]]
      map snd (said (crowdedBy 1 29)) `shouldBe` ["e"]
    it "has no tangle of arrows at ten within two seconds" $ do
      let arrows =
            [ d
            | e <- allOf "path" (drawn (crowdedBy 10 0.2))
            , attribute "class" e == "ar"
            , let d = attribute "d" e
            ]
          ranges = [(minimum xs, maximum xs) | d <- arrows, 'V' `elem` d, 'H' `notElem` d, let (xs, _) = outline d]
      length ranges `shouldBe` 10
      [(b, a') | ((_, b), (a', _)) <- zip (sort ranges) (drop 1 (sort ranges)), a' <= b] `shouldBe` []
      [d | d <- arrows, 'H' `elem` d, 'v' `elem` d] `shouldBe` []
    it "has no name below bars that are too short for their own" $
      let below events =
            [ textOf t
            | t <- allOf "text" (drawn (map (renamedTo "investigate") (filter (not . isReaction) events)))
            , attribute "class" t == "n"
            ]
       in map below [crowdedBy 5 0.6, crowdedBy 2 0.25 ++ ended 99 (Inside 1) "" 30.5 Nothing 60 Succeeded]
         `shouldBe` [[], []]
    it "has no arrow over a bar" $ [n | n <- [1 .. 9], not (null (crossed (drawn (robots n))))] `shouldBe` []

  describe "shows what runs nowhere" $ do
    it "as waiting for the signal that ended it" $
      texts (drawn waited) `shouldSatisfy` elem "waiting until order True"
    it "as a time, if it is not known what it was" $
      texts (drawn [e | e <- waited, not (isReaction e)])
        `shouldSatisfy` \known -> "5 s" `elem` known && not (any ("waiting until" `isInfixOf`) known)
    it "not as waiting, if a monitor's recovery has run" $
      texts (drawn (map (byOperator "monitor") waited))
        `shouldSatisfy` \known -> "5 s" `elem` known && not (any ("waiting until" `isInfixOf`) known)
    it "with no text over its line" $
      [ (l, t)
        | t@(y', left, right) <- pauseTexts waited
        , l@(y, a, b) <- pauseLines waited
        , abs (y' - 4 - y) < 1
        , a < right
        , b > left
        ]
        `shouldBe` []

  describe "names the part that finished" $ do
    it "so that others were stopped" $
      texts (drawn (beside 5)) `shouldSatisfy` elem "listenstopped: \"look\" finished"
    it "not one that ended earlier" $
      texts (drawn (beside 4)) `shouldSatisfy` elem "listenstopped: the left branch finished"
    it "or the signal that was awaited beside it" $ do
      let button n = Reaction n (Inside 1) "waitUntil" 20 [Change "red button" (Just "False") "True"] Nothing Nothing
          pressed = [button 3]
          doubtful =
            [ untilButton 1 pressed
            , untilButton 0 []
            , untilButton 0 [button 3, button 4]
            , untilButton 0 [(button 3) {reactionOperator = "switch"}]
            , untilButton 0 [(button 3) {reactionParent = Inside 2}]
            , untilButton 0 [(button 3) {reactionChanges = []}]
            , untilButton 0 pressed ++ ended 5 (Inside 1) "look" 0 Nothing 20 Succeeded
            ]
      title (untilButton 0 pressed) `shouldBe` "mission was ended by red button True after 20 s:interrupted once"
      texts (drawn (untilButton 0 pressed)) `shouldSatisfy` elem "red button True\8594 stopped \"patrol\" after 20 s"
      -- Not if it is not known that this ended it.
      map (take 17 . title) doubtful `shouldBe` map (const "mission succeeded") doubtful

  describe "has another mark for what succeeded in vain" $ do
    let marked events =
          [ head (lines (textOf b))
          | b <- allOf "path" (drawn events)
          , "a" `elem` words (attribute "class" b)
          , not (null (textOf b))
          ]
    it "and ran again" $ marked wateredAgain `shouldBe` ["bed 1", "bed 2"]
    it "not if it did not run again" $ marked [e | e <- wateredAgain, notBed "bed 1" e || not (isLater e)]
      `shouldBe` ["bed 2"]
    it "not if what it ran in succeeded" $ marked (map succeeding wateredAgain) `shouldBe` []
    it "and its text says that" $ texts (drawn wateredAgain) `shouldSatisfy` elem "bed 15 s, ran again"

  it "cuts no name to less than six letters" . property $ forAllBlind likelyEvents $ \events ->
    let cut =
          [ t
          | g <- allOf "g" (drawn (map (renamedTo "investigate the north wall") events))
          , attribute "class" g == "l"
          , t <- map textOf (allOf "text" g)
          , "in" `isPrefixOf` t
          , '…' `elem` t
          ]
     in counterexample (show cut) (all ((> 6) . length) cut)

  it "has a legend that is no wider than the picture" . property $ forAllBlind likelyEvents $ \events ->
    conjoin [ counterexample (textOf t) (attributeOf "x" t + 6.5 * fromIntegral (length (textOf t)) <= 1200)
            | g <- allOf "g" (drawn events)
            , attribute "class" g == "le"
            , t <- allOf "text" g
            ]

  it "has a line to each text that is outside of its bar" $ do
    let events =
          ended 1 Top "mission" 0 Nothing 100 Succeeded ++ ended 2 (Inside 1) "photograph" 50 Nothing 51 Succeeded
        ends = [d | e <- allOf "path" (drawn events), attribute "class" e == "ld", let d = attribute "d" e]
        left = [x | t <- allOf "text" (drawn events), "photograph" `isPrefixOf` textOf t, x <- [attributeOf "x" t]]
    length ends `shouldBe` 1
    -- From 51 % of the width to the text.
    (takeWhile (/= ' ') (drop 1 (head ends)), reverse (takeWhile (/= 'H') (reverse (head ends))))
      `shouldBe` ("611.4", "622.4")
    left `shouldBe` [625.4]

drawn :: [Event] -> Xml
drawn events = either error id (readXml (Lazy.unpack (timeline (recording events))))

allOf :: String -> Xml -> [Xml]
allOf name x = [e | e@(Element name' _ _) <- everything x, name' == name]

texts :: Xml -> [String]
texts = map textOf . allOf "text"

title :: [Event] -> String
title events = head [textOf t | t <- allOf "text" (drawn events), attribute "class" t == "t"]

whereMost :: [Event] -> String
whereMost events =
  head [ rest
       | t <- texts (drawn events)
       , begin <- ["time:", "the longest:"]
       , Just rest <- map (stripPrefix begin) (tails t)
       ]

legend :: [Event] -> [String]
legend events = [textOf t | g <- allOf "g" (drawn events), attribute "class" g == "le", t <- allOf "text" g]

attributeOf :: String -> Xml -> Double
attributeOf name x = read (if '.' `elem` text then text else text ++ ".0")
 where
  text = attribute name x

splits :: String -> [(String, String)]
splits text = [splitAt k text | k <- [0 .. length text]]

-- The arrows from markers that go through a bar.
crossed :: Xml -> [(Double, Double)]
crossed picture =
  [ (x, top)
  | a <- allOf "path" picture
  , attribute "class" a == "ar"
  , 'V' `elem` attribute "d" a
  , (x : _, y : y' : _) <- [outline (attribute "d" a)]
  , b <- allOf "path" picture
  , "b" `elem` words (attribute "class" b)
  , not (null (textOf b))
  , (xs@(_ : _), ys) <- [outline (attribute "d" b)]
  , let top = minimum ys
  , minimum xs < x - 1 && maximum xs > x + 1 && top > y && top < y'
  ]

-- The lines of pauses: where, from where, to where; and their texts.
pauseLines, pauseTexts :: [Event] -> [(Double, Double, Double)]
pauseLines events =
  [ (y, a, b)
  | p <- allOf "path" (drawn events)
  , attribute "class" p == "wt"
  , not (null (textOf p))
  , (a : b : _, y : _) <- [outline (attribute "d" p)]
  ]
pauseTexts events =
  [ (attributeOf "y" t, middle - half, middle + half)
  | t <- allOf "text" (drawn events)
  , attribute "class" t == "n q c"
  , let middle = attributeOf "x" t
  , let half = 2.6 * fromIntegral (length (textOf t))
  ]
