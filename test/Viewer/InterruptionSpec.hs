module Viewer.InterruptionSpec (spec) where

import Data.List (foldl', isInfixOf)
import qualified Data.Text.Lazy as Text
import Test.Hspec

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Recording
import Behavior.Trace.Svg
import Behavior.Trace.Terminal.Live (nothingYet, watch)
import Behavior.Trace.Terminal.Screen (plain)
import Behavior.Trace.Terminal.Tree
import Behavior.Trace.Tree
import Viewer.Xml

spec :: Spec
spec = do
  it "is described with the names of the spans" $
    inTree patrol
      `shouldBe` ["battery 9.4 -> batteryLow True -> stopped \"drive\" after 3.1 s (took 0.3 s) -> \"recharge\""]
  it "is described in the same words in the terminal" $
    inTerminal patrol
      `shouldBe` ["battery 9.4 -> batteryLow True", "stopped \"drive\" after 3.1 s (took 0.3 s) -> \"recharge\""]
  it "is described in the same words in the timeline" $
    inTimeline patrol
      `shouldBe` ["battery 9.4 -> batteryLow True -> stopped \"drive\" after 3.1 s (took 0.3 s) -> \"recharge\""]
  it "is described in the same words where operators and branches are shown too" $ do
    inTree detailedPatrol `shouldBe` inTree patrol
    inTerminal detailedPatrol `shouldBe` inTerminal patrol
    inTimeline detailedPatrol `shouldBe` inTimeline patrol
  it "is described with the operator's names of the branches where no span has a name" $ do
    let text = "stopped its task after 3.1 s (took 0.3 s) -> recovery"
    inTree nameless `shouldBe` ["battery 9.4 -> batteryLow True -> " ++ text]
    inTerminal nameless `shouldBe` ["battery 9.4 -> batteryLow True", text]
    inTimeline nameless `shouldBe` ["battery 9.4 -> batteryLow True -> " ++ text]
  it "is described with the operator's name where no signal has one" $ do
    inTree (map unnamed nameless)
      `shouldBe` ["monitor changed -> stopped its task after 3.1 s (took 0.3 s) -> recovery"]
    take 1 (inTerminal (map unnamed nameless)) `shouldBe` ["monitor changed"]
  it "has the time of the span that was stopped, not that of its branch" $ do
    let sentence = "stopped \"drive\" after 3.1 s (took 0.3 s) -> \"recharge\""
    inTree secondStep `shouldBe` ["battery 9.4 -> batteryLow True -> " ++ sentence]
    inTerminal secondStep `shouldBe` ["battery 9.4 -> batteryLow True", sentence]
    inTimeline secondStep `shouldBe` ["battery 9.4 -> batteryLow True -> " ++ sentence]
  it "has the time of each span, if they differ" $ do
    inTree (stoppedAt 60 [57, 55])
      `shouldSatisfy` any ("stopped \"robot 1\" after 3 s, \"robot 2\" after 5 s (took" `isInfixOf`)
    inTree (stoppedAt 60 [57, 55, 55, 55])
      `shouldSatisfy` any ("\"robot 2\" after 5 s, \"robot 3\" after 5 s and 1 more (took" `isInfixOf`)
    inTerminal (stoppedAt 60 [57, 55])
      `shouldSatisfy` any ("stopped \"robot 1\" after 3 s, \"robot 2\" after 5 s (took" `isInfixOf`)
  it "has no negative time, if a span began while its branch was stopped" $
    inTree (stoppedAt 60 [60.1]) `shouldSatisfy` any ("stopped \"robot 1\" after 0 s (took" `isInfixOf`)
  it "says how long stopping took only if it took a time" $ do
    let atOnce took end =
          [if isReaction e then reactionThat (Just (StoppedBranch "task" 3.1 took end)) else e | e <- patrol]
        sentence = "battery 9.4 -> batteryLow True -> stopped \"drive\" after 3.1 s -> \"recharge\""
    map (\took -> inTree (atOnce took (low 4))) [0, 0.00001] `shouldBe` [[sentence], [sentence]]
    inTerminal (atOnce 0 (low 4))
      `shouldBe` ["battery 9.4 -> batteryLow True", "stopped \"drive\" after 3.1 s -> \"recharge\""]
    inTimeline (atOnce 0 (low 4)) `shouldBe` [sentence]
    inTree (atOnce 0 Succeeded) `shouldSatisfy` any ("after 3.1 s (it completed nevertheless) ->" `isInfixOf`)
  it "says what starts, if nothing was stopped" $ do
    let events = [if isReaction e then reactionThat Nothing else e | e <- patrol]
    inTree events `shouldBe` ["battery 9.4 -> batteryLow True -> starts \"recharge\""]
    [t | t <- timelineTexts events, "starts" `isInfixOf` t]
      `shouldBe` ["battery 9.4 -> batteryLow True -> starts \"recharge\""]
  it "has the names of all spans that were stopped, up to three" $ do
    inTree (several 3) `shouldSatisfy` any ("stopped \"robot 1\", \"robot 2\", \"robot 3\" after" `isInfixOf`)
    inTree (several 5)
      `shouldSatisfy` any ("stopped \"robot 1\", \"robot 2\", \"robot 3\" and 2 more after" `isInfixOf`)
    inTerminal (several 5)
      `shouldSatisfy` any ("stopped \"robot 1\", \"robot 2\", \"robot 3\" and 2 more after" `isInfixOf`)
  it "has the first span that was started, if there are several" $ do
    let events = patrol ++ [Began (Span 9 (Inside 1) Named "later" 50 (Just 4))]
    inTree events `shouldBe` inTree patrol
    inTerminal events `shouldBe` inTerminal patrol
  it "has a failure without the words that the library puts before it" $ do
    let failed text = [Ended (Span 1 Top Named "open" 0 Nothing) 1 (FailedWith text)]
    tree (failed "the behaviour failed: the front door is locked")
      `shouldSatisfy` any ("open: failed: the front door is locked" `isInfixOf`)
    tree (failed "the behaviour failed") `shouldSatisfy` ("open: failed" `elem`) . map (drop 23)
    concatMap
      (plainTexts . (: []))
      (treeLines 30 100 1 (foldl' watch nothingYet (failed "the behaviour failed: the front door is locked")))
      `shouldSatisfy` any ("failed: the front door is locked" `isInfixOf`)
 where
  tree = lines . renderTree . recording
  plainTexts = map plain

-- The texts of reactions in the tree.
inTree :: [Event] -> [String]
inTree events =
  [drop 2 text | line <- lines (renderTree (recording events)), text@('!' : _) <- [dropWhile (/= '!') line]]

-- The two lines in the terminal.
inTerminal :: [Event] -> [String]
inTerminal events =
  case dropWhile ((/= "◆ ") . take 2) (map plain (treeLines 30 200 100 (foldl' watch nothingYet events))) of
  first : second : _ -> [takeWhile (/= ',') (drop 2 first), drop 2 second]
  _ -> []

-- The label beside the marker; the arrow is another character there.
inTimeline :: [Event] -> [String]
inTimeline events = [text | text <- timelineTexts events, "-> stopped " `isInfixOf` text]

-- The texts of two parts.
timelineTexts :: [Event] -> [String]
timelineTexts events =
  [ concatMap (\c -> if c == '→' then "->" else [c]) (unwords [textOf p | p <- parts])
  | Element "text" _ parts <- either error everything (readXml (Text.unpack (timeline (recording events))))
  , length parts == 2
  ]

changes :: [Change]
changes = [Change "battery" Nothing "9.4", Change "batteryLow" Nothing "True"]

low :: Int -> End
low n = StoppedBy (SignalChanged n changes)

reaction :: Event
reaction = reactionAt 3.1

-- It stops a branch that began at 0.
reactionAt :: Seconds -> Event
reactionAt = reactionIn (Inside 1)

reactionIn :: Parent -> Seconds -> Event
reactionIn parent t = Reacted (Reaction 4 parent "monitor" t changes (Just stopped) (Just "recovery"))
 where
  stopped = StoppedBranch "task" t 0.3 (low 4)

reactionThat :: Maybe StoppedBranch -> Event
reactionThat stopped = Reacted (Reaction 4 (Inside 1) "monitor" 3.1 changes stopped (Just "recovery"))

isReaction :: Event -> Bool
isReaction event = case event of
  Reacted _ -> True
  _ -> False

-- A span is stopped with one in it; another one is started.
patrol :: [Event]
patrol =
  [ Began (Span 1 Top Named "patrol" 0 Nothing)
  , Began (Span 2 (Inside 1) Named "drive" 0 Nothing)
  , Began (Span 3 (Inside 2) Named "steer" 1 Nothing)
  , Ended (Span 3 (Inside 2) Named "steer" 1 Nothing) 3.4 (low 4)
  , Ended (Span 2 (Inside 1) Named "drive" 0 Nothing) 3.4 (low 4)
  , reaction
  , Began (Span 5 (Inside 1) Named "recharge" 3.4 (Just 4))
  , Began (Span 6 (Inside 5) Named "dock" 3.4 Nothing)
  , Ended (Span 6 (Inside 5) Named "dock" 3.4 Nothing) 10 Succeeded
  , Ended (Span 5 (Inside 1) Named "recharge" 3.4 (Just 4)) 60 Succeeded
  , Ended (Span 1 Top Named "patrol" 0 Nothing) 60 Succeeded
  ]

detailedPatrol :: [Event]
detailedPatrol =
  [ Began (Span 1 Top Named "patrol" 0 Nothing)
  , Began operator
  , Began task
  , Began drive
  , Ended drive 3.4 (low 4)
  , Ended task 3.4 (low 4)
  , reactionIn (Inside 10) 3.1
  , Began recovery
  , Began recharge
  , Ended recharge 60 Succeeded
  , Ended recovery 60 Succeeded
  , Ended operator 60 Succeeded
  , Ended (Span 1 Top Named "patrol" 0 Nothing) 60 Succeeded
  ]
 where
  operator = Span 10 (Inside 1) Operator "monitor" 0 Nothing
  task = Span 11 (Inside 10) Branch "task" 0 Nothing
  drive = Span 12 (Inside 11) Named "drive" 0 Nothing
  recovery = Span 13 (Inside 10) Branch "recovery" 3.4 (Just 4)
  recharge = Span 14 (Inside 13) Named "recharge" 3.4 Nothing

-- The branch has run for a minute, its second step only at the end.
secondStep :: [Event]
secondStep =
  [ Began (Span 1 Top Named "patrol" 0 Nothing)
  , Ended (Span 2 (Inside 1) Named "plan" 0 Nothing) 56.9 Succeeded
  , Ended (Span 3 (Inside 1) Named "drive" 56.9 Nothing) 60.3 (low 4)
  , reactionAt 60
  , Began (Span 5 (Inside 1) Named "recharge" 60.3 (Just 4))
  , Ended (Span 5 (Inside 1) Named "recharge" 60.3 (Just 4)) 90 Succeeded
  , Ended (Span 1 Top Named "patrol" 0 Nothing) 90 Succeeded
  ]

nameless :: [Event]
nameless = [Began patrolling, reaction, Ended patrolling 60 Succeeded]
 where
  patrolling = Span 1 Top Named "patrol" 0 Nothing

unnamed :: Event -> Event
unnamed event = case event of
  Reacted r -> Reacted r {reactionChanges = []}
  other -> other

several :: Int -> [Event]
several n = stoppedAt 3.1 (replicate n 0)

-- Several spans, each of which began at one of these times.
stoppedAt :: Seconds -> [Seconds] -> [Event]
stoppedAt t begins =
  concat [[Began robot, Ended robot (t + 0.3) (low 4)] | robot <- zipWith robotFrom [1 ..] begins] ++ [reactionAt t]
 where
  robotFrom k begin = Span (10 + k) Top Named ("robot " ++ show k) begin Nothing
