module Viewer.TerminalSpec (spec) where

import qualified Data.ByteString as Strict
import Data.Char (isDigit)
import Data.List (foldl', isInfixOf, isPrefixOf)
import qualified Data.Text as Text
import qualified Data.Text.Encoding as Text
import System.IO
import Test.Hspec hiding (after, before)
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck hiding (output)

import Behavior.Trace
import Behavior.Trace.Terminal
import Behavior.Trace.Terminal.Live (nothingYet, watch)
import Behavior.Trace.Terminal.Screen (columns, frame, plain)
import Behavior.Trace.Terminal.Tree
import Temporary
import Viewer.Examples
import Viewer.Generate
import Viewer.Golden
import Viewer.Screen

spec :: Spec
spec = do
  describe "in a window of 100 columns" $
    goldenText "mission-terminal.txt" (unlines (map plain (treeLines 30 100 40 (after mission))))

  describe "in a window of 36 columns and 12 lines" $
    goldenText "mission-terminal-narrow.txt" (unlines (map plain (treeLines 12 36 40 (after mission))))

  it "says what runs and since when" $
    shown (treeLines 30 100 9 (after (take 8 mission)))
      `shouldBe` [ "● mission 9.0 s"
                 , "  · enter room 5.6 s"
                 , "    ✗ front door failed after 1.9 s: locked"
                 , "    · back door 3.6 s"
                 , "  ● survey 3.0 s"
                 , "✗ front door: failed: locked in mission > enter room, 6.6 s ago"
                 ]

  it "says the last interruption with its cause" $
    shown (treeLines 30 100 19.1 (after mission))
      `shouldSatisfy` isInfixOf
        [ "◆ battery 9.4 (was 100) -> batteryLow True (was False), 10.0 s ago"
        , "  stopped \"survey\" after 3.1 s (took 0.3 s) -> \"recharge\""
        ]

  it "says a failure once that came out of several spans" $ do
    let outer = Span 1 Top Named "outer" 0 Nothing
        inner = Span 2 (Inside 1) Named "inner" 0 Nothing
        events = [Began outer, Began inner, Ended inner 1 (FailedWith "locked"), Ended outer 1 (FailedWith "locked")]
    shown (treeLines 30 100 3 (after events))
      `shouldBe` [ "✗ outer failed after 1 s: locked"
                 , "  ✗ inner failed after 1 s: locked"
                 , "✗ inner: failed: locked in outer, 2.0 s ago"
                 ]

  it "shows no span as running whose end was lost, once its parent has ended" $ do
    let a = Span 1 Top Named "a" 0 Nothing
        b = Span 2 (Inside 1) Named "b" 0 Nothing
        c = Span 3 (Inside 2) Named "c" 0 Nothing
        events = [Began a, Began b, Began c, Lost 2, Ended a 1 Succeeded]
    filter ("●" `isInfixOf`) (shown (treeLines 30 80 2 (after events)))
      `shouldBe` []

  prop "is no wider and no higher than the window, and contains nothing that a terminal obeys" $
    forAllBlind likelyEvents $ \events -> forAll (choose (1, 90)) $ \width -> forAll (choose (1, 40)) $ \rows ->
      let tree = shown (treeLines rows width 61 (after events))
       in counterexample (unlines tree) $
            conjoin
              [ counterexample "too high" (length tree <= rows)
              , counterexample "too wide" (all ((<= width) . columns) tree)
              , counterexample "control characters" (all (all isHarmless) tree)
              ]

  it "counts two columns for wide characters" $
    map columns ["\x4E16\x754C", "\xD55C", "\x1F916", "a\x301", "ab"] `shouldBe` [4, 2, 2, 1, 2]

  it "always shows what runs, if there are more lines than the window has" $
    shown (treeLines 6 60 50 (after (take 200 (long 1000))))
      `shouldSatisfy` (\tree -> any ("● patrol" `isPrefixOf`) tree && any ("more" `isInfixOf`) tree)

  describe "needs memory that does not grow" $ do
    let size = length . show . after
    it "when spans end" $ size (long 100000) `shouldSatisfy` (< 20000)
    it "when spans are nested without end" $ size (take 100000 (nested 100000)) `shouldSatisfy` (< 500000)
    it "when many run at once" $ size (take 50000 (sideBySide 50000)) `shouldSatisfy` (< 500000)
    it "when many fail" $ size (failing 50000) `shouldSatisfy` (< 5000)
    it "when texts are long" $ size oddEvents `shouldSatisfy` (< 50000)

  describe "A frame" $ do
    prop "replaces the frame before" $
      forAllBlind (listOf1 (resize 20 likelyEvents)) $ \batches ->
        let trees = map (treeLines 12 40 61) (tail (scanl (foldl' watch) nothingYet batches))
            written = concat (zipWith (frame True id) (0 : map length trees) trees)
         in screenOf written === shown (last trees)

    it "has no colours if there are to be none" $ do
      let tree = treeLines 30 100 40 (after mission)
      frame False id 3 tree `shouldSatisfy` not . coloured
      frame True id 3 tree `shouldSatisfy` coloured

  it "is plain lines where the output is no terminal" . withPath $ \path -> do
    withFile path WriteMode $ \h -> do
      hSetEncoding h utf8
      withTerminal h $ \sink -> sink (take 5 mission) *> sink (drop 5 mission)
    text <- Text.decodeUtf8 <$> Strict.readFile path
    lines (Text.unpack text) `shouldBe` map plainLine mission

  it "writes also where the output has no Unicode" . withPath $ \path -> do
    withFile path WriteMode $ \h -> do
      hSetEncoding h latin1
      withTerminal h $ \sink -> sink [Began (Span 1 Top Named "\x4E16 door" 0 Nothing)]
    Strict.readFile path `shouldReturn` Text.encodeUtf8 (Text.pack "0.000 + ? door\n")
 where
  after = foldl' watch nothingYet
  shown = map plain

coloured :: String -> Bool
coloured ('\ESC' : '[' : rest) | (digits, 'm' : _) <- span (\c -> isDigit c || c == ';') rest = not (null digits)
coloured (_ : rest) = coloured rest
coloured [] = False
