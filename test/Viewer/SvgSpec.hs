module Viewer.SvgSpec (spec) where

import Data.Char (isDigit)
import Data.List (isInfixOf, isPrefixOf, nub, (\\))
import qualified Data.Text.Lazy as Lazy
import Test.Hspec hiding (after)
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck

import Behavior.Internal.Tracing.Text
import Behavior.Trace
import Behavior.Trace.Recording
import Behavior.Trace.Svg
import Viewer.Examples
import Viewer.Generate
import Viewer.Golden
import Viewer.Shapes
import Viewer.Xml

spec :: Spec
spec = do
  goldenSvg "mission-timeline.svg" (timeline (recording mission))

  describe "is one file that does nothing" $ do
    let check events = case readXml (svg events) of
          Left why -> counterexample why False
          Right x ->
            conjoin
              [ nub [name | Element name _ _ <- everything x]
                  \\ words "svg style defs pattern rect g path text tspan title" === []
              , nub [name | Element _ attributes _ <- everything x, (name, _) <- attributes]
                  \\ words "xmlns class role aria-label width height viewBox id patternUnits d x y dx"
                  === []
              , counterexample "only ASCII" (all (< '\x7F') (svg events))
              , counterexample "an address" (not (any (`isInfixOf` style x) ["http", "url(//", "@import", "url(\""]))
              ]
        style x = concat [textOf s | s@(Element "style" _ _) <- everything x]
    it "with texts that could do harm" $ once (check oddEvents)
    it "without events" $ once (check [])
    it "with times that are no numbers" $
      once (check [ Ended (Span 1 Top Named "a" (0 / 0) Nothing) (1 / 0) Succeeded
                  , Began (Span 2 Top Named "b" (-1 / 0) Nothing)
                  ])
    prop "with any events" $ forAllBlind likelyEvents check

  it "shows the texts as they are" $
    let shown = titles (drawn oddEvents)
    in [name | name <- take 4 oddTexts, not (any ((name ++ "\n") `isPrefixOf`) shown)] `shouldBe` []

  describe "has less than 300 KB at 10,000 spans" $ do
    let size = length . svg
        chinese = concatMap (map (renamed (replicate 40 '\x4E16')))
    it "one after the other" $ size (long 10000) `shouldSatisfy` (< 300000)
    it "nested" $ size (nested 10000) `shouldSatisfy` (< 300000)
    it "at the same time" $ size (sideBySide 10000) `shouldSatisfy` (< 300000)
    it "of many robots" $ size (fleet 10000) `shouldSatisfy` (< 300000)
    it "that all fail" $ size (failing 10000) `shouldSatisfy` (< 300000)
    it "that are all interrupted" $ size (interrupted 10000) `shouldSatisfy` (< 300000)
    it "with long names that are not in ASCII" $ size (chinese [long 10000]) `shouldSatisfy` (< 300000)
    it "and at 100,000" $ size (long 100000) `shouldSatisfy` (< 300000)

  describe "shows all that failed, faulted or was stopped" $ do
    let counts events =
          [ (c, sum [count m | m <- bars (drawn events), c `elem` words (attribute "class" m)])
          | c <- ["f", "x", "p"]
          ]
        expected events =
          [ (c, length [() | Ended _ _ end <- events, kind end == c])
          | c <- ["f", "x", "p"]
          ]
        kind end = case end of
          Succeeded -> "s"
          FailedWith _ -> "f"
          FaultedWith _ -> "x"
          StoppedBy _ -> "p"
    it "among 10,000 spans" $ do
      counts (long 10000) `shouldBe` expected (long 10000)
      map snd (counts (long 10000)) `shouldSatisfy` all (> 0)
    it "with all outcomes in turn" $ counts (mixed 10000) `shouldBe` expected (mixed 10000)
    it "if all failed" $ counts (failing 10000) `shouldBe` expected (failing 10000)
    it "if all were stopped" $ counts (interrupted 10000) `shouldBe` expected (interrupted 10000)
    prop "of any spans" $ forAllBlind likelyEvents $ \events -> counts events === expected events
    it "with marks that can be seen" $
      [m | m <- bars (drawn (long 10000)), any (`elem` words (attribute "class" m)) ["f", "x", "p"], pathWidth m < 1]
        `shouldBe` []

  describe "draws an interruption from the signal's change to what was stopped, and on to what was started" $ do
    it "in a mission" $ once (arrowsComplete mission)
    prop "in any number of rounds" $ forAll (choose (2, 30)) (arrowsComplete . interrupted)
    it "with arrows that do not touch" $ once (arrowsApart (interrupted 60))
    it "and has no other arrows" $ do
      length (reactionsOf mission) `shouldBe` 2
      length (arrowsOf (drawn mission)) `shouldBe` 3

  it "labels the marker with the values" $
    textsOf (drawn mission)
      `shouldSatisfy` elem "battery 9.4 (was 100) → batteryLow True\
                           \→ stopped \"survey\" after 3.1 s (took 0.3 s) → \"recharge\""

  it "shows the text of a failure" $
    textsOf (drawn mission)
      `shouldSatisfy` (\texts -> all (`elem` texts) ["failed: locked", "faulted: camera: no such device"])

  prop "has no two texts one over the other" $
    forAllBlind (oneof [ map (renamed "drive to it") <$> likelyEvents
                       , pure mission
                       , failing <$> choose (1, 60)
                       , interrupted <$> choose (1, 30)
                       ]) $ \events ->
      let texts =
            [ (num "y" t, left, left + wide)
            | t@(Element "text" _ _) <- everything (drawn events)
            , "c" `notElem` words (attribute "class" t)
            , let wide = 5 * fromIntegral (length (textOf t))
            , let left = if attribute "class" t == "e" then num "x" t - wide else num "x" t
            ]
          overlaps =
            [ (a, b)
            | (k, a@(y, left, right)) <- zip [0 :: Int ..] texts
            , (l, b@(y', left', _)) <- zip [0 ..] texts
            , k /= l
            , y == y'
            , left' >= left
            , left' < right
            ]
       in counterexample (show overlaps) (null overlaps)

-- Each reaction has an arrow from a marker to a span that it stopped; and one from there to a span
-- that it started, or from the marker if it stopped none.
arrowsComplete :: [Event] -> Property
arrowsComplete events = conjoin (map complete (reactionsOf events))
 where
  complete r =
    counterexample (show r) $
      conjoin
        [ counterexample "no arrow from the marker" $
            or
              [ fromMarkerTo (not (null stopped)) b arrow
              | b <- if null stopped then started else stopped
              , arrow <- arrows
              ]
        , counterexample "no arrow to what was started" $
            null stopped || null started || or [on s a && onEdge t b | s <- stopped, t <- started, (a, b) <- arrows]
        ]
   where
    stopped =
      [ b
      | n <- nodes known
      , Just (_, StoppedBy (SignalChanged k _)) <- [nodeEnd n]
      , k == reactionNumber r
      , b <- boxOf n
      ]
    started = [b | n <- nodes known, spanReaction (nodeSpan n) == Just (reactionNumber r), b <- boxOf n]
  -- To a place where it is clear which bar it is.
  fromMarkerTo isStopped (left, right, top, _) ((x, y), (x', y')) =
    and
      [ abs (x - x') < 12
      , near y' top
      , x' >= left + inside (not isStopped) - 0.6
      , x' <= right - inside isStopped + 0.6
      , any (\(dx, dy) -> near dx x && abs (dy - y) < 8) markers
      ]
   where
    inside there = if there then min 8 ((right - left) / 3) else 0
  on (left, right, _, bottom) (x, y) = near y bottom && x >= left - 0.2 && x <= right + 0.2
  onEdge (left, right, top, bottom) (x, y) = x >= left - 0.2 && x <= right + 0.2 && y >= top - 0.2 && y <= bottom + 0.2
  near a b = abs (a - b) < 0.2
  known = recording events
  picture = drawn events
  arrows = arrowsOf picture
  markers =
    [ (x + 6, y)
    | e@(Element "path" _ (_ : _)) <- everything picture
    , attribute "class" e `elem` ["i", "io"]
    , x : y : _ <- [numbers (attribute "d" e)]
    ]
  boxOf n =
    [ box m
    | m <- bars picture
    , name : more <- [lines (textOf m)]
    , name == spanName s
    , ("from " ++ secondsText (spanBegan s - recordingFrom known)) `elem` more
    ]
   where
    s = nodeSpan n
  box m = (minimum xs, maximum xs, minimum ys, maximum ys)
   where
    (xs, ys) = outline (attribute "d" m)

-- Of the arrows from one bar to the next, none begins or ends where another one does.
arrowsApart :: [Event] -> Property
arrowsApart events = counterexample (show xs) (length xs > 50 && and (zipWith (<) xs (drop 1 xs)))
 where
  xs = concat [[x, x'] | ((x, y), (x', y')) <- arrowsOf (drawn events), y == y']

reactionsOf :: [Event] -> [Reaction]
reactionsOf = recordingReactions . recording

-- Where the arrows begin and end, without those of the legend. The two strokes of the head belong to each.
arrowsOf :: Xml -> [((Double, Double), (Double, Double))]
arrowsOf x =
  concatMap
    ends
    [ attribute "d" a
    | g@(Element "g" _ inner) <- everything x
    , attribute "class" g /= "le"
    , a@(Element "path" _ _) <- inner
    , attribute "class" a == "ar"
    ]
 where
  ends d = case outline (takeWhile (/= 'm') d) of
    (xs@(_ : _ : _), ys) | any (`elem` d) "VC" -> [((head xs, head ys), (last xs, last ys))]
    _ -> []

svg :: [Event] -> String
svg = Lazy.unpack . timeline . recording

drawn :: [Event] -> Xml
drawn events = either error id (readXml (svg events))

-- The shapes of spans: those that have a title and are no markers.
bars :: Xml -> [Xml]
bars x =
  [ e
  | e@(Element "path" _ inner) <- everything x
  , attribute "class" e `notElem` ["i", "io"]
  , not (null [() | Element "title" _ _ <- inner])
  ]

textsOf :: Xml -> [String]
textsOf x = [textOf t | t@(Element "text" _ _) <- everything x]

titles :: Xml -> [String]
titles x = [textOf t | t@(Element "title" _ _) <- everything x]

-- How many spans a mark stands for.
count :: Xml -> Int
count m = case words (textOf m) of
  n : "spans" : _ | "m" `elem` words (attribute "class" m), all isDigit n, n /= "1" -> read n
  _ -> 1

num :: String -> Xml -> Double
num name = head . (++ [0]) . numbers . attribute name

pathWidth :: Xml -> Double
pathWidth m = maximum xs - minimum xs
 where
  (xs, _) = outline (attribute "d" m)

renamed :: String -> Event -> Event
renamed name event = case event of
  Began s -> Began s {spanName = name}
  Ended s t end -> Ended s {spanName = name} t end
  _ -> event
