module Sim.RecordSpec (spec, line, recordOf) where

import Control.Exception (ErrorCall (..), evaluate)
import Data.Foldable (for_)
import Test.Hspec

import Behavior (Seconds)
import Behavior.Sim.Mock
import Support (guarded)

spec :: Spec
spec = guarded $ do
  describe "A record" aRecord
  describe "A claim" $ do
    describe "of existence" existence
    describe "of absence" absence
    describe "of number" number
    describe "of universality" universality
    describe "of precedence" precedence
    describe "of response" response
    describe "of several claims" conjunction
    describe "that does not hold" refutation
  describe "Moments" moments
  describe "Intervals" whiles

-- | An entry of a subject without arguments, in its first call.
line :: Seconds -> String -> EntryKind -> RecordEntry
line t who = RecordEntry t who "" 1

-- | A record that ends with its last entry.
recordOf :: [(String, SubjectKind)] -> [RecordEntry] -> Record
recordOf subjects rows = Record subjects rows (maximum (0 : map entryTime rows))

-- | A robot drives, its battery runs low, it stops slowly and charges; the battery is
-- full again, and a second drive fails.
day :: Record
day =
  recordOf
    [("low", ACondition), ("drive", AnAction), ("charge", AnAction), ("sing", AnAction)]
    [ line 0 "low" (Is "False")
    , line 1 "drive" Begins
    , line 4 "low" (Becomes "True")
    , line 4 "drive" StopRequested
    , line 5 "drive" Stops
    , line 5 "charge" Begins
    , line 9 "low" (Becomes "False")
    , line 9 "charge" Succeeds
    , RecordEntry 9 "drive" "" 2 Begins
    , RecordEntry 12 "drive" "" 2 (Fails "stuck")
    , line 12 "help!" Noted
    ]

-- | Each of the claims holds, or none does.
hold, doNotHold :: [Claim] -> Expectation
hold claims = for_ claims $ \claim -> verdict claim day `shouldBe` Right ()
doNotHold claims = for_ claims $ \claim -> day `shouldNotSatisfy` holds claim

aRecord :: Spec
aRecord = do
  it "is shown as a timeline, with a line for each entry" $
    lines (show day)
      `shouldBe` [ " 0.0 s  low: is False"
                 , " 1.0 s  drive: begins"
                 , " 4.0 s  low: becomes True"
                 , " 4.0 s  drive: stop requested"
                 , " 5.0 s  drive: has stopped"
                 , " 5.0 s  charge: begins"
                 , " 9.0 s  low: becomes False"
                 , " 9.0 s  charge: done"
                 , " 9.0 s  drive: begins (call 2)"
                 , "12.0 s  drive: fails, stuck (call 2)"
                 , "12.0 s  help!"
                 ]

  it "shows times without rounding errors" $
    show (recordOf [("a", AnAction)] [line (0.1 + 0.2) "a" Begins]) `shouldBe` "0.3 s  a: begins\n"

existence :: Spec
existence = do
  it "holds for an entry of the record" $
    hold [eventually (startOf "charge"), eventually (noted "help!"), eventually (failureOf "drive")]

  it "does not hold without such an entry" $
    doNotHold [eventually (startOf "sing"), eventually (faultOf "drive"), eventually (noted "help")]

  it "with a limit holds up to and including the limit" $ do
    hold [withinSeconds 5 (startOf "charge"), withinSeconds 12 (failureOf "drive")]
    doNotHold [withinSeconds 4.9 (startOf "charge"), withinSeconds 100 (startOf "sing")]

  it "holds despite rounding errors" $
    recordOf [("a", AnAction)] [line (0.1 + 0.2) "a" Begins] `shouldSatisfy` holds (withinSeconds 0.3 (startOf "a"))

  it "rejects an invalid limit" $
    for_ [(-1, "-1.0"), (0 / 0, "NaN")] $ \(limit, shown) ->
      evaluate (holds (whenever (startOf "sing") (withinSeconds limit (startOf "sing"))) day)
        `shouldThrow` (== ErrorCall ("withinSeconds: a limit is zero or more seconds, not " ++ shown))

absence :: Spec
absence = do
  it "holds without such an entry" $
    hold [never (startOf "sing"), never (faultOf "drive")]
  it "does not hold for an entry of the record" $
    doNotHold [never (startOf "charge"), never (anyOf [startOf "sing", startOf "charge"])]

number :: Spec
number = do
  it "holds for the exact number of entries" $ do
    hold [exactly 2 (startOf "drive"), exactly 0 (startOf "sing"), exactly 1 (successOf "charge")]
    doNotHold [exactly 1 (startOf "drive"), exactly 3 (startOf "drive")]
    countOf (endOf "drive") day `shouldBe` 2
  it "says once for one" $ do
    let said claim = either (take 2 . lines) (const []) (verdict claim day)
    said (exactly 1 (startOf "drive"))
      `shouldBe` ["This does not hold: exactly once \"drive\" begins.", "It was so 2 times:"]
    said (exactly 2 (startOf "charge"))
      `shouldBe` ["This does not hold: exactly 2 times \"charge\" begins.", "It was so once:"]
    said (exactly 1 (startOf "sing"))
      `shouldBe` ["This does not hold: exactly once \"sing\" begins.", "It was so 0 times:"]

universality :: Spec
universality = do
  it "holds when the interval includes all later entries" $
    hold [whenever (failureOf "drive") (always (being "low" False))]
  it "does not hold when the interval is interrupted" $
    doNotHold
      [ always (being "low" False)
      , always (running "drive")
      , whenever (startOf "charge") (always (being "low" True))
      ]
  it "disregards the entries that set the world up" $
    recordOf [("a", ACondition), ("b", ACondition)] [line 0 "a" (Is "1"), line 0 "b" (Is "2"), line 1 "a" (Becomes "3")]
      `shouldSatisfy` holds (always (being "b" (2 :: Int)))

precedence :: Spec
precedence = do
  it "holds when the first comes first, or the second never comes" $
    hold
      [ startOf "drive" `comesBefore` startOf "charge"
      , interruptionOf "drive" `comesBefore` endOf "drive"
      , startOf "sing" `comesBefore` faultOf "drive"
      ]
  it "does not hold when the second comes first, or without the first" $
    doNotHold
      [ startOf "charge" `comesBefore` startOf "drive"
      , startOf "sing" `comesBefore` startOf "drive"
      , startOf "drive" `comesBefore` startOf "drive"
      ]

response :: Spec
response = do
  it "is about all later entries, each time" $ do
    hold
      [ whenever (becoming "low" True) (eventually (startOf "charge"))
      , whenever (becoming "low" True) (withinSeconds 1 (startOf "charge"))
      , whenever (startOf "drive") (eventually (endOf "drive"))
      , whenever (startOf "sing") (eventually (endOf "sing"))
      ]
    doNotHold
      [ whenever (becoming "low" False) (eventually (startOf "charge"))
      , whenever (becoming "low" True) (withinSeconds 0.5 (startOf "charge"))
      , whenever (startOf "drive") (eventually (startOf "drive"))
      ]

  it "nests" $ do
    hold [whenever (becoming "low" True) (whenever (startOf "drive") (eventually (failureOf "drive")))]
    doNotHold [whenever (becoming "low" True) (whenever (startOf "drive") (eventually (startOf "charge")))]

conjunction :: Spec
conjunction =
  it "holds when all do" $ do
    hold [mempty, eventually (startOf "drive") <> never (startOf "sing")]
    doNotHold
      [ eventually (startOf "drive") <> never (startOf "charge")
      , never (startOf "charge") <> never (startOf "sing")
      ]

refutation :: Spec
refutation = do
  it "is reported with the entries that disprove it" $
    verdict (whenever (becoming "low" True) (withinSeconds 0.5 (startOf "charge"))) day
      `shouldBe` Left
        ( unlines
            [ "This does not hold: whenever \"low\" becomes True, within 0.5 s \"charge\" begins."
            , "From 4.0 s on, it came only at 5.0 s:"
            , "     0.0 s  low: is False"
            , "     1.0 s  drive: begins"
            , "  >  4.0 s  low: becomes True"
            , "     4.0 s  drive: stop requested"
            , "     5.0 s  drive: has stopped"
            , "  >  5.0 s  charge: begins"
            , "     9.0 s  low: becomes False"
            , "     9.0 s  charge: done"
            , "    ..."
            ]
        )

  it "is reported with the end of the record when an entry never came" $
    verdict (eventually (startOf "sing")) day
      `shouldBe` Left
        ( unlines
            [ "This does not hold: eventually \"sing\" begins."
            , "It never came:"
            , "    ..."
            , "     9.0 s  low: becomes False"
            , "     9.0 s  charge: done"
            , "     9.0 s  drive: begins (call 2)"
            , "    12.0 s  drive: fails, stuck (call 2)"
            , "    12.0 s  help!"
            ]
        )


moments :: Spec
moments = do
  it "are those of one argument, or of any argument" $ do
    let doors =
          recordOf
            [("open", AnActionOn)]
            [ RecordEntry 0 "open" "\"front\"" 1 Begins
            , RecordEntry 1 "open" "\"front\"" 1 (Fails "locked")
            , RecordEntry 1 "open" "\"back\"" 1 Begins
            ]
    countOf (startOf "open") doors `shouldBe` 2
    countOf (startOf "open \"front\"") doors `shouldBe` 1
    doors `shouldSatisfy` holds (never (startOf "open \"cellar\""))

  it "are not those of another subject with the same prefix" $
    countOf (startOf "open") (recordOf [("open", AnAction), ("open door", AnAction)] [line 0 "open door" Begins])
      `shouldBe` 0

  it "of anyOf are those of each alternative, counted once" $
    countOf (anyOf [startOf "drive", startOf "charge", startOf "drive"]) day `shouldBe` 3

  it "can be restricted to an interval, or to the time outside of it" $ do
    countOf (startOf "drive" `outside` being "low" True) day `shouldBe` 2
    countOf (startOf "charge" `during` being "low" True) day `shouldBe` 1
    countOf (startOf "charge" `during` running "drive") day `shouldBe` 0
    countOf (endOf "drive" `during` running "drive") day `shouldBe` 0
    countOf (becoming "low" True `during` running "drive") day `shouldBe` 1

whiles :: Spec
whiles = do
  it "overlap when one begins before the other has ended" $ do
    let one = [line 0 "a" Begins, line 1 "b" Begins, line 2 "a" Succeeds, line 3 "b" Succeeds]
        nested = [line 0 "b" Begins, line 1 "a" Begins, line 2 "a" Succeeds, line 3 "b" Succeeds]
        apart = [line 0 "a" Begins, line 1 "a" Succeeds, line 1 "b" Begins, line 3 "b" Succeeds]
        open = [line 0 "a" Begins, line 5 "b" Begins]
        overlaps rows =
          countOf (running "a" `overlapping` running "b") (recordOf [("a", AnAction), ("b", AnAction)] rows)
    map overlaps [one, nested, apart, open] `shouldBe` [1, 1, 0, 1]

  it "overlap with themselves when two calls run at once" $ do
    let rows =
          [ RecordEntry 0 "a" "" 1 Begins
          , RecordEntry 1 "a" "" 2 Begins
          , RecordEntry 2 "a" "" 1 Succeeds
          , RecordEntry 3 "a" "" 3 Begins
          , RecordEntry 4 "a" "" 2 Stops
          ]
    countOf (running "a" `overlapping` running "a") (recordOf [("a", AnAction)] rows) `shouldBe` 2

  it "include the cleanup" $
    countOf (interruptionOf "drive" `during` running "drive") day `shouldBe` 1

  describe "that have been going on for some time" $ do
    let rover = [("low", ACondition), ("drive", AnAction)]
        held = never . (running "drive" `overlapping`) . (being "low" True `heldFor`)
    it "do not hold a tie against an action, nor what has ended in time" $ do
      let ends t =
            [line 0 "drive" Begins, line 4 "low" (Becomes "True"), line t "drive" Stops, line 9 "low" (Becomes "False")]
          starts t = [line 4 "low" (Becomes "True"), line t "drive" Begins, line 9 "low" (Becomes "False")]
          holding claim rows = holds claim (recordOf rover rows)
      [holding (held s) (ends t) | (s, t) <- [(0, 4), (0, 4.05), (0.1, 4.05), (0.1, 4.1), (0.1, 4.2)]]
        `shouldBe` [True, False, True, True, False]
      -- An action that is not stopped at all overlaps, even if it begins within the grace.
      [holding (held s) (starts t) | (s, t) <- [(0, 4), (0.1, 4), (0.1, 4.05), (0.1, 5), (6, 5)]]
        `shouldBe` [False, False, False, False, True]
    it "restrict moments, and hold always, only then" $ do
      countOf (interruptionOf "drive" `during` being "low" True) day `shouldBe` 1
      countOf (interruptionOf "drive" `during` (being "low" True `heldFor` 0)) day `shouldBe` 0
      map (\s -> countOf (startOf "charge" `during` (being "low" True `heldFor` s)) day) [0.9, 1, 5, 6]
        `shouldBe` [1, 0, 0, 0]
      map (\s -> holds (whenever (startOf "charge") (always (running "charge" `heldFor` s))) day) [0, 1]
        `shouldBe` [False, False]
      hold [whenever (endOf "drive" `during` (being "low" True `heldFor` 0.5)) (withinSeconds 0 (startOf "charge"))]
    it "overlap each other" $
      for_ [(`heldFor` 1), \i -> i `heldFor` 1 `heldFor` 1] $ \late ->
        let rows = [line 0 "drive" Begins, line 0 "low" (Becomes "True"), line 5 "drive" Succeeds]
         in countOf (late (running "drive") `overlapping` late (being "low" True)) (recordOf rover rows) `shouldBe` 1
    it "are those of the interval, if that is one of these" $
      map (\s -> countOf (startOf "charge" `during` (being "low" True `heldFor` 0.5 `heldFor` s)) day) [0.4, 0.5]
        `shouldBe` [1, 0]
    it "are shown with the time at which they begin" $
      (Record rover [line 0 "drive" Begins, line 4 "low" (Becomes "True")] 5, held 0.1)
        `refutedBy` [ "This does not hold: never \"drive\" is running while \"low\" is True for over 0.1 s."
                    , "It was so at 4.1 s:"
                    ]
  describe "shortly after a moment" $ do
    it "include what is recorded at the same time before it, and what comes in time after it" $ do
      let found rows = countOf (noted "x" `during` shortlyAfter 0.1 (startOf "a")) (recordOf [("a", AnAction)] rows)
      [found [line t "x" Noted, line 5 "a" Begins] | t <- [4.9, 5]] `shouldBe` [0, 1]
      [found [line 5 "a" Begins, line t "x" Noted] | t <- [5, 5.1, 5.2]] `shouldBe` [1, 1, 0]
    it "say why something may happen" $ do
      hold
        [ never (interruptionOf "drive" `outside` shortlyAfter 0 (becoming "low" True))
        , never (startOf "charge" `outside` shortlyAfter 1 (becoming "low" True))
        ]
      doNotHold [never (startOf "charge" `outside` shortlyAfter 0.9 (becoming "low" True))]
    it "can overlap with others" $
      map (\s -> countOf (running "charge" `overlapping` shortlyAfter s (becoming "low" True)) day) [0.9, 1]
        `shouldBe` [0, 1]
  it "need a number of seconds that is zero or more" $
    for_ [-1, 0 / 0] $ \s -> do
      evaluate (holds (always (being "low" True `heldFor` s)) day)
        `shouldThrow` (== ErrorCall ("heldFor: zero or more seconds, not " ++ show s))
      evaluate (holds (always (shortlyAfter s (startOf "drive"))) day)
        `shouldThrow` (== ErrorCall ("shortlyAfter: zero or more seconds, not " ++ show s))
      -- Also where what is inside of it never happens.
      evaluate (holds (never (failureOf "charge" `during` (being "low" True `heldFor` s))) day)
        `shouldThrow` (== ErrorCall ("heldFor: zero or more seconds, not " ++ show s))
      evaluate (holds (never (failureOf "charge" `during` shortlyAfter s (startOf "drive"))) day)
        `shouldThrow` (== ErrorCall ("shortlyAfter: zero or more seconds, not " ++ show s))

  it "end when the condition loses its value" $ do
    let rows = [line 0 "x" (Becomes "1"), line 1 "x" LosesValue, line 2 "a" Begins]
    countOf (startOf "a" `during` being "x" (1 :: Int)) (recordOf [("x", ACondition), ("a", AnAction)] rows)
      `shouldBe` 0
 where
  (record, claim) `refutedBy` text =
    either (take (length text) . lines) (const []) (verdict claim record) `shouldBe` text
