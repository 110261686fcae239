-- | Claims that would hold, or not hold, for a wrong reason: about the end of a run, and about names.
module Sim.ClaimSpec (spec) where

import Control.Exception (ErrorCall (..), evaluate)
import Data.Foldable (for_)
import Data.List (isInfixOf)
import Test.Hspec

import Behavior
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Sim.Mock
import Sim.RecordSpec (line, recordOf)
import Support (guarded)

spec :: Spec
spec = guarded $ do
  describe "At the end of a run, a claim" atTheEnd
  describe "The names in a claim" names

-- | Runs a robot that drives for a minute, whose battery is low at 4 s, up to the given time; then says what is wrong
-- with a claim about it.
endedAt :: Seconds -> Claim -> IO [String]
endedAt end claim = do
  world <- newMock
  low <- condition world "low" [(0, False), (4, True)]
  drive <- action world "drive" [succeeds `taking` 60 `slowToStop` 20]
  charge <- action world "charge" [succeeds]
  run <- simulateWith defaultSimOptions {endAt = end} $
    drive ||| (Signal.waitUntil (signal low) >> sleep 90 >> charge)
  finished run `shouldBe` end
  record <- happened world
  recordEnd record `shouldBe` end
  pure (wrong (verdict claim record))

-- | The claim that does not hold, and why.
wrong :: Either String () -> [String]
wrong = either (map (drop (length prefix)) . take 1 . lines <> take 1 . drop 1 . lines) (const [])
 where
  prefix = "This does not hold: "

atTheEnd :: Spec
atTheEnd = do
  it "knows of no interval that would have begun later" $
    for_ [1, 100, 1 / 0] $ \s ->
      endedAt 5 (never (running "drive" `overlapping` (being "low" True `heldFor` s))) `shouldReturn` []

  it "knows of one that began after the last entry" $
    endedAt 5 (never (running "drive" `overlapping` (being "low" True `heldFor` 0.5)))
      `shouldReturn` ["never \"drive\" is running while \"low\" is True for over 0.5 s.", "It was so at 4.5 s:"]

  it "knows when two of them overlap there" $ do
    let low s = never ((being "low" True `heldFor` 0.2) `overlapping` shortlyAfter s (becoming "low" True))
    for_ [0.1, 0.2] $ \s -> endedAt 5 (low s) `shouldReturn` []
    endedAt 5 (low 0.5)
      `shouldReturn` [ "never \"low\" is True for over 0.2 s while within 0.5 s after \"low\" becomes True."
                     , "It was so at 4.2 s:"
                     ]

  it "does not hold, when its limit has not passed: the text says so" $ do
    let charges limit = whenever (becoming "low" True) (withinSeconds limit (startOf "charge"))
        late limit why =
          [ "whenever \"low\" becomes True, within " ++ limit ++ " \"charge\" begins."
          , "From 4.0 s on, it never came" ++ why
          ]
    endedAt 5 (charges 10) `shouldReturn` late "10.0 s" " (the record ends at 5.0 s, before the limit):"
    endedAt 5 (charges 1) `shouldReturn` late "1.0 s" ":"
    endedAt 5 (charges 0.5) `shouldReturn` late "0.5 s" ":"
    endedAt 5 (eventually (startOf "charge")) `shouldReturn` ["eventually \"charge\" begins.", "It never came:"]

  it "is about the time from the last entry to the end too" $ do
    endedAt 60 (always (shortlyAfter 60 (startOf "drive"))) `shouldReturn` []
    endedAt 60 (always (shortlyAfter 5 (startOf "drive")))
      `shouldReturn` ["always within 5.0 s after \"drive\" begins.", "It was not so after 5.0 s:"]
    endedAt 60 (whenever (becoming "low" True) (always (shortlyAfter 5 (becoming "low" True))))
      `shouldReturn` [ "whenever \"low\" becomes True, always within 5.0 s after \"low\" becomes True."
                     , "From 4.0 s on, it was not so after 9.0 s:"
                     ]
    let untouched = Record [("low", ACondition)] [line 0 "low" (Is "False")] 60
    wrong (verdict (always (being "low" False)) untouched) `shouldBe` []
    wrong (verdict (always (being "low" True)) untouched)
      `shouldBe` ["always \"low\" is True.", "It was not so at 60.0 s:"]

  it "is about the time between two entries too" $ do
    let beats times = recordOf [("beat", AnAction)] [line t "beat" Begins | t <- times]
        steady = always (shortlyAfter 5 (startOf "beat"))
    map (holds steady . beats) [[0, 5, 10], [0.1, 5.1, 10.1], [0, 4, 9.1], []] `shouldBe` [True, True, False, False]

  it "is about the time since a moment, where that is given" $ do
    let early = recordOf [("a", AnAction)] [line 0 "a" Begins, line 9 "a" Succeeds, line 9 "a" Begins]
    wrong (verdict (whenever (successOf "a") (always (shortlyAfter 1 (startOf "a")))) early) `shouldBe` []

names :: Spec
names = do
  it "are known in its world" $
    for_ unknown $ \claim -> verdict claim world `refusedAs` "Nothing in this world is called"

  it "are those of what can do this" $
    for_ neverSo $ \(claim, claimText, why) ->
      wrong (verdict claim world) `shouldBe` [claimText ++ ".", why]

  it "are those of what can do this, if there is anything" $
    wrong (verdict (never (becoming "drive" True)) (recordOf [("drive", AnAction)] []))
      `shouldBe` [ "never \"drive\" becomes True."
                 , "\"drive\" is an action, and never becomes True. This world has no sensors or conditions."
                 ]

  it "are accepted where they are" $
    for_ possible $ \m -> do
      verdict (never m) world `shouldBe` Right ()
      countOf m world `shouldBe` 0

  it "are those of the whole claim" $ do
    for_ impossible $ \m -> verdict (never m) world `refusedAs` " never "
    for_ claims $ \claim -> verdict claim world `refusedAs` "\"low\" is a condition, and"

  it "are those of moments that are counted, too: others are errors" $ do
    for_ ["drvie", "low"] $ \name ->
      evaluate (countOf (startOf name) world) `shouldThrow` \(ErrorCall why) ->
        lines why == drop 1 (wrong (verdict (never (startOf name)) world))

  it "have arguments as they are shown: without the quotes, or with others, it is an error" $ do
    for_ misspelt $ \(given, shown) -> do
      let why = "\"open\" was not called as " ++ show given ++ ", but as " ++ show shown ++ "."
      for_ [never (startOf given), whenever (startOf given) mempty, never (startOf "drive" `during` running given)] $
        \claim -> drop 1 (wrong (verdict claim (calledWith [shown, "open \"attic\""]))) `shouldBe` [why]
      evaluate (countOf (endOf given) (calledWith [shown])) `shouldThrow` (== ErrorCall why)

  it "have values as they are shown: one of another type, or a number of another, is an error" $ do
    let been value = recordOf [("level", ACondition)] [line 0 "level" (Is value)]
    for_ [never (becoming "level" (5 :: Int)), never (becoming "level" (5 :: Int) `outside` being "level" (5 :: Int))] $
      \claim ->
        drop 1 (wrong (verdict claim (been "5.0"))) `shouldBe` ["\"level\" was not recorded as 5, but as 5.0."]
    drop 1 (wrong (verdict (never (becoming "level" "Low")) (been "Low")))
      `shouldBe` ["\"level\" was not recorded as \"Low\", but as Low."]
    for_ ["6.0", "-5.0", "55", "True"] $ \value ->
      wrong (verdict (never (becoming "level" (5 :: Int))) (been value)) `shouldBe` []
    wrong (verdict (eventually (becoming "level" (5 :: Int))) (been "5")) `shouldBe` []

  it "have any argument otherwise: it is not known which there are" $
    for_ otherArguments $ \(given, shown) -> do
      wrong (verdict (never (startOf given)) (calledWith shown)) `shouldBe` []
      countOf (startOf given) (calledWith shown) `shouldBe` 0

  it "have an argument, unless something is called so" $ do
    let door = recordOf [("open", AnActionOn), ("open front", AnAction)] [call "open \"front\""]
    wrong (verdict (never (startOf "open front")) door) `shouldBe` []

  it "are no notes; but a note in another spelling is an error" $ do
    let came = recordOf [("orders", ADriver)] [line 1 text Noted | text <- ["orders: \"tea\"", "ready"]]
    for_ [never (noted "orders: tea"), whenever (noted "orders: tea") mempty] $ \claim ->
      drop 1 (wrong (verdict claim came)) `shouldBe` ["\"orders: tea\" was not noted, but \"orders: \\\"tea\\\"\"."]
    for_ ["orders: milk", "tea", "not ready"] $ \text -> wrong (verdict (never (noted text)) came) `shouldBe` []
    wrong (verdict (eventually (noted "orders: \"tea\"")) came) `shouldBe` []

  it "are at least one" $
    evaluate (countOf (anyOf []) world) `shouldThrow` (== ErrorCall "anyOf: at least one moment")

  it "are said to be what the functions of the world have made" $ do
    mock <- newMock
    _ <- condition mock "c" [(0, 'x')]
    _ <- partialCondition mock "p" [(0, Just 'x')]
    _ <- action mock "a" [succeeds]
    _ <- actionOn mock "on" (\x -> [returning (x :: Int)])
    _ <- sensor mock "s" [returning 'x']
    _ <- driver mock "d" [(0, 'x')]
    begin mock
    recordSubjects <$> happened mock
      `shouldReturn` ([("c", ACondition), ("p", ACondition), ("a", AnAction), ("on", AnActionOn)]
                        ++ [("s", ASensor), ("d", ADriver)])
 where
  world = recordOf ([("low", ACondition), ("drive", AnAction), ("open", AnActionOn)] ++ others) []
  others = [("camera", ASensor), ("orders", ADriver)]
  call shown = RecordEntry 0 "open" (drop 5 shown) 1 Begins
  calledWith = recordOf [("drive", AnAction), ("open", AnActionOn)] . map call
  misspelt =
    [ ("open front", "open \"front\"")
    , ("open 'f'", "open \"f\"")
    , ("open front", "open 'front'")
    , ("open \"3\"", "open 3")
    , ("open front", "open Door \"front\"")
    , ("open front door", "open [\"front door\"]")
    , ("open (-3)", "open -3")
    , ("open 3", "open 3.0")
    , ("open (1, 2)", "open (1,2)")
    , ("open At {x=1,y=2}", "open At {x = 1, y = 2}")
    , ("open 3", "open Just 3")
    , ("open -3", "open Just (-3)")
    ]
  otherArguments =
    [ ("open \"cellar\"", ["open \"front\""])
    , ("open cellar", ["open \"front\""])
    , ("open \"door\"", ["open \"front door\""])
    , ("open \"front, door\"", ["open \"front door\""])
    , ("open North", ["open Going North"])
    , ("open 3", ["open 13"])
    , ("open '+'", ["open '-'"])
    , ("open '('", ["open ')'"])
    , ("open 'x'", [])
    ]
  found `refusedAs` text = found `shouldSatisfy` either (text `isInfixOf`) (const False)
  unknown =
    [ never (startOf "drvie")
    , startOf "drvie" `comesBefore` startOf "open"
    , never (startOf "open ")
    , never (startOf "open" `during` being "lwo" True)
    , never (startOf "low 'x'")
    ]
  neverSo =
    [ ( never (startOf "low")
      , "never \"low\" begins"
      , "\"low\" is a condition, and never begins. The actions of this world: \"drive\", \"open\"."
      )
    , ( never (becoming "drive" True)
      , "never \"drive\" becomes True"
      , "\"drive\" is an action, and never becomes True. The sensors and conditions of this world: \"low\", \"camera\"."
      )
    , ( exactly 0 (successOf "camera")
      , "exactly 0 times \"camera\" is done"
      , "\"camera\" is a sensor, and is never done. The actions of this world: \"drive\", \"open\"."
      )
    , ( never (failureOf "orders")
      , "never \"orders\" fails"
      , "\"orders\" is a driver, and never fails. "
          ++ "The actions and sensors of this world: \"drive\", \"open\", \"camera\"."
      )
    , ( never (startOf "drive \"fast\"")
      , "never \"drive \\\"fast\\\"\" begins"
      , "\"drive\" is an action without an argument, so nothing is called \"drive \\\"fast\\\"\"."
      )
    ]
  possible =
    map startOf ["drive", "open", "open \"front\""]
      ++ [endOf "open", successOf "open", interruptionOf "drive", becoming "low" True, becoming "camera" 'x']
      ++ [happens x | happens <- [failureOf, faultOf], x <- ["drive", "camera"]]
      ++ map noted ["orders", "low", "anything"]
  impossible =
    [ startOf "drive" `during` being "drive" True
    , startOf "drive" `outside` running "low"
    , running "drive" `overlapping` running "camera"
    , anyOf [startOf "drive", startOf "low"]
    , startOf "drive" `during` (being "drive" True `heldFor` 1)
    , startOf "drive" `during` shortlyAfter 1 (endOf "low")
    ]
  claims =
    [ whenever (startOf "low") mempty
    , whenever (startOf "drive") (never (endOf "low"))
    , startOf "low" `comesBefore` startOf "drive"
    , never (startOf "drive") <> always (running "low")
    , exactly 0 (interruptionOf "low")
    , withinSeconds 1 (startOf "low")
    ]
