{-# LANGUAGE OverloadedStrings #-}

module Viewer.FileSpec (spec) where

import Control.Exception (ErrorCall (..), IOException, evaluate, throwIO, try)
import Control.Monad (forM_)
import qualified Data.ByteString.Lazy.Char8 as Bytes
import Data.Either (isRight)
import Data.IORef
import Data.Int (Int64)
import Data.List (isInfixOf)
import qualified Data.Text.Lazy as Text
import qualified Data.Text.Lazy.Encoding as Text
import System.IO (IOMode (..), hClose, openBinaryFile)
import System.Posix.Files (createNamedPipe, ownerModes)
import System.Process (readProcess)
import Test.Hspec
import Test.QuickCheck

import Behavior.Sim (Outcome (..), outcome, simulate)
import Behavior.Time (now, sleep)
import Behavior.Trace
import Behavior.Trace.Diff (difference, renderDifference)
import Behavior.Trace.File
import Behavior.Trace.Format (decodeEvent)
import Behavior.Trace.Otlp (renderOtlp)
import Behavior.Trace.Recording (recording, withoutOperators)
import Behavior.Trace.Summary (renderSummary, summary)
import Behavior.Trace.Svg (timeline)
import Behavior.Trace.TraceEvents (renderTraceEvents)
import Behavior.Trace.Tree (renderTree)
import Temporary
import Viewer.Examples
import Viewer.Generate
import Viewer.Golden

spec :: Spec
spec = do
  describe "is written so that" $ do
    it "it can be read back" . property $ \(AnyEvents events) ->
      parseTrace (renderTrace header events) === Right (header, map replaced events, Nothing)
    it "NaN can be read back" $
      case parseTrace (renderTrace header [Began (Span 1 Top Named "x" (0 / 0) Nothing)]) of
        Right (_, [Began s], Nothing) -> spanBegan s `shouldSatisfy` isNotANumber
        other -> expectationFailure (show other)
    it "each event is one line, without a character that a terminal or a page acts on" . property $
      \(AnyEvents events) ->
        let content = renderTrace header events
            decoded = Text.unpack (Text.decodeUtf8 content)
        in conjoin
            [ Bytes.count '\n' content === fromIntegral (length events + 1)
            , filter (\c -> c /= '\n' && (not (isHarmless c) || c `elem` ("<>&" :: String))) decoded === ""
            ]
    it "a megabyte of text can be read back" $ do
      let events = [Ended (Span 1 Top Named (replicate 1048576 '\ESC') 0 Nothing) 1 (FailedWith "")]
      parseTrace (renderTrace header events) `shouldBe` Right (header, events, Nothing)
    describe "the file of a mission" (golden "mission.jsonl" (renderTrace header mission))
    describe "the file with all kinds of events" (golden "detailed.jsonl" (renderTrace header detailed))
    describe "the file with odd texts" (golden "odd.jsonl" (renderTrace header (textInAllPlaces oddTexts)))

  describe "while a program runs" $ do
    it "contains a batch as soon as it was written" . withPath $ \path -> do
      shown <- withTraceFile path $ \write -> do
        write (take 2 mission)
        first <- readProcess "cat" [path] ""
        write (take 1 (drop 2 mission))
        second <- readProcess "cat" [path] ""
        pure [first, second]
      map (length . lines) shown `shouldBe` [3, 4]
    it "has times relative to when it was created, and durations as they were" . withPath $ \path -> do
      run <- simulate $ do
        sleep 100
        withTraceFile path $ \write -> do
          sleep 2.5
          t <- now
          let began = Span 1 Top Named "x" t Nothing
              stopped = StoppedBranch "x" 3 4 Succeeded
              reaction = Reaction 2 Top "o" t [] (Just stopped) Nothing
          write [Began began, Ended began (t + 1) (StoppedBy (TimeLimit 1)), Reacted reaction]
      case outcome run of
        Returned () -> pure ()
        _ -> expectationFailure "the simulation did not return"
      let began = Span 1 Top Named "x" 2.5 Nothing
          stopped = StoppedBranch "x" 3 4 Succeeded
          reaction = Reaction 2 Top "o" 2.5 [] (Just stopped) Nothing
      content <- Bytes.readFile path
      fmap (\(_, events, _) -> events) (parseTrace content)
        `shouldBe` Right [Began began, Ended began 3.5 (StoppedBy (TimeLimit 1)), Reacted reaction]
    it "stays readable, and later events are added, when the text of an event throws" . withPath $ \path -> do
      failed <- withTraceFile path $ \write -> do
        failed <- try (write (mission ++ [Began (Span 99 Top Named ("half" ++ error "text") 0 Nothing)]))
        write [Lost 1]
        pure failed
      either (\(ErrorCall why) -> why) (const "written") failed `shouldBe` "text"
      content <- Bytes.readFile path
      fmap (\(_, events, torn) -> (events, torn)) (parseTrace content) `shouldBe` Right ([Lost 1], Nothing)
    it "contains what was written when the action throws" . withPath $ \path -> do
      result <-
        try (withTraceFile path (\write -> write [Lost 1] >> throwIO (ErrorCall "mission"))) :: IO (Either ErrorCall ())
      result `shouldBe` Left (ErrorCall "mission")
      content <- Bytes.readFile path
      fmap (\(_, events, torn) -> (events, torn)) (parseTrace content) `shouldBe` Right ([Lost 1], Nothing)
    it "does not change what the action returns when it cannot be written any more" . withPath $ \path -> do
      createNamedPipe path ownerModes
      reader <- openBinaryFile path ReadMode
      (result, failures) <- withTraceFile path $ \write -> do
        write [Lost 1]
        hClose reader
        first <- try (write [Lost 2])
        -- Were it written now, it could follow a part of a line.
        reader2 <- openBinaryFile path ReadMode
        second <- try (write [Lost 3])
        hClose reader2
        pure ("the result" :: String, map (either (const True) (const False)) [first, second :: Either IOException ()])
      (result, failures) `shouldBe` ("the result", [True, True])
    it "fails before the action starts when it cannot be created" $ do
      started <- newIORef False
      forM_ ["/dev/full", "/no/such/folder/trace"] $ \path -> do
        result <- try (withTraceFile path (const (writeIORef started True))) :: IO (Either IOException ())
        result `shouldSatisfy` either (const True) (const False)
      readIORef started `shouldReturn` False

  describe "that is damaged" $ do
    it "can be truncated at every byte: only the last line is incomplete" . withMaxSuccess 30 . property $
      \(AnyEvents events) ->
        forAll (choose (0, 4)) $ \few ->
          conjoin (map (truncated (take few events)) [0 .. Bytes.length (renderTrace header (take few events))])
    it "can be truncated at every byte, also the one with all kinds of events" $
      forM_ [take 6 mission, detailed] $ \events ->
        forM_ [0 .. Bytes.length (renderTrace header events)] $ \n ->
          quickCheckWithResult stdArgs {maxSuccess = 1, chatty = False} (truncated events n)
            >>= (`shouldSatisfy` isSuccess)
    it "can end with an incomplete line, or with zeros" $ do
      let torn end = fmap (\(_, events, line) -> (events, line)) (parseTrace (renderTrace header [Lost 1] <> end))
      torn "{\"event\":\"lo" `shouldBe` Right ([Lost 1], Just (TornLine 3 12))
      torn "\NUL\NUL\NUL" `shouldBe` Right ([Lost 1], Just (TornLine 3 3))
    it "is refused with a last line that is complete, and is no JSON" $
      forM_ ["{\"event\":\"lo\n", "\n", "\NUL\n"] $ \end ->
        problem (renderTrace header [Lost 1] <> end) `shouldStartWith` "line 3: this is not a line of JSON: "
    it "is refused with the line in the middle that is no JSON" $
      problem (renderTrace header [Lost 1] <> "{\"event\":\"lo\n" <> "{\"event\":\"lost\",\"count\":1}\n")
        `shouldStartWith` "line 3: this is not a line of JSON: "
    it "is refused with a line that is no event, also the last one" $
      problem (renderTrace header [Lost 1] <> "{\"event\":\"sent\"}\n")
        `shouldSatisfy` \why ->
          all (`isInfixOf` why) ["line 3: this is no event: ", "\"sent\"; allowed: began, ended, reacted, lost"]
    it "is refused with an empty line in the middle" $
      problem (renderTrace header [Lost 1] <> "\n{\"event\":\"lost\",\"count\":1}\n")
        `shouldStartWith` "line 3: this is not a line of JSON"
    it "is refused when a field is missing or has another type" $
      forM_
        [ "{\"event\":\"lost\"}"
        , "{\"event\":\"lost\",\"count\":\"2\"}"
        , "{\"event\":\"lost\",\"count\":1e400}"
        , "{\"event\":\"began\",\"number\":1,\"parent\":null,\"kind\":\"named\",\"name\":\"x\",\"began\":0}"
        , "[]"
        , "7"
        ]
        $ \line ->
          problem (renderTrace header [] <> line <> "\n") `shouldStartWith` "line 2: this is no event: "
    it "is refused when a span or a reaction is in itself, in a later one, or has a number below 1" $
      forM_ [(1, 1), (1, 2), (3, 3), (3, 4), (3, 0), (3, -1), (0, -1), (maxBound, maxBound)] $ \(n, parent) ->
        forM_
          [ Began (Span n (Inside parent) Operator "x" 0 Nothing)
          , Ended (Span n (Inside parent) Named "x" 0 Nothing) 1 Succeeded
          , Reacted (Reaction n (Inside parent) "x" 0 [] Nothing Nothing)
          ]
          $ \event ->
            problem (renderTrace header [event])
              `shouldSatisfy` \why -> all (`isInfixOf` why) ["line 2: this is no event: ", "; allowed: "]
    it "is refused when no events, fewer, or more than can be counted were lost" $ do
      forM_ [0, -1, minBound] $ \n ->
        problem (renderTrace header [Lost n]) `shouldSatisfy` isInfixOf "line 2: this is no event: "
      parseTrace (renderTrace header [Lost (maxBound - 1), Lost 1])
        `shouldBe` Right (header, [Lost (maxBound - 1), Lost 1], Nothing)
      problem (renderTrace header [Lost maxBound, Began (Span 1 Top Named "x" 0 Nothing), Lost 1])
        `shouldStartWith` "line 4: "
    it "is refused when it is empty" $ problem "" `shouldStartWith` "line 1: the file is empty; allowed: "
    it "is refused when it is something else" $ do
      forM_ ["hello\nworld", "\NUL\ESC[2J\255", "{}", "{\"format\":\"speedscope\"}\n", "[1,2]\n", "\n"] $ \content ->
        problem content `shouldStartWith` "line 1: this is no trace: "
      problem "\ESC[2J" `shouldSatisfy` notElem '\ESC'
    it "is refused when its version is another one" $ do
      problem "{\"format\":\"behavior-trace\",\"version\":2,\"start\":7}\n"
        `shouldStartWith` "line 1: version 2 of the format; allowed: version 1"
      problem "{\"format\":\"behavior-trace\",\"version\":0}\n" `shouldStartWith` "line 1: this header is damaged: "
    it "is refused when its header is damaged" $
      forM_
        [ "{\"format\":\"behavior-trace\",\"version\":1}\n"
        , "{\"format\":\"behavior-trace\",\"version\":1,\"zero\":\"noon\"}\n"
        , "{\"format\":\"behavior-trace\",\"vers\n{\"event\":\"lost\",\"count\":1}\n"
        ]
        $ \content ->
          problem content `shouldStartWith` "line 1: this header is damaged: "
    it "is read or refused, whatever the bytes are" . property $ \bytes position ->
      let content = renderTrace header mission
          (start, rest) = Bytes.splitAt (position `mod` Bytes.length content) content
          changed = start <> Bytes.pack bytes <> Bytes.drop (fromIntegral (length bytes)) rest
          shown = either (length . explainTraceError) (\(h, es, torn) -> length (show (h, es, torn)))
      in ioProperty (True <$ evaluate (shown (parseTrace changed)))
    it "is refused when a line has a million opening brackets, also the last one, before it is parsed" $
      forM_ [Bytes.replicate 1000000 '[', mconcat (replicate 1000000 "{\"x\":")] $ \line ->
        forM_ ["", "\n", "\n" <> encodedLost] $ \end ->
          problem (renderTrace header [] <> line <> end)
            `shouldStartWith` "line 2: this is no event: it nests deeper than 100; allowed: "
    it "is read when the texts of a line have brackets, and when a field that is not known nests a little" $ do
      let events = [Began (Span 1 Top Named (concat (replicate 1000 "[{\"\\")) 0 Nothing)]
      parseTrace (renderTrace header events) `shouldBe` Right (header, events, Nothing)
      let lost = "{\"x\":" <> Bytes.replicate 50 '[' <> Bytes.replicate 50 ']' <> ",\"event\":\"lost\",\"count\":1}\n"
      fmap (\(_, found, _) -> found) (parseTrace (renderTrace header [] <> lost))
        `shouldBe` Right [Lost 1]
    it "is read or refused, and shown in every way, whichever byte is another one" . withMaxSuccess 20 . property $
      \byte ->
        let content = renderTrace header detailed
            changed n = Bytes.take n content <> Bytes.cons byte (Bytes.drop (n + 1) content)
            shown events =
              concat
                [ renderTree r
                , renderSummary (summary r)
                , renderDifference (difference r r)
                , Text.unpack (timeline r)
                , Text.unpack (Text.decodeUtf8 (renderTraceEvents r))
                , Text.unpack (Text.decodeUtf8 (renderOtlp "Ann" header r))
                , concatMap plainLine events
                ]
             where
              r = recording (withoutOperators events)
        in forAll (choose (0, Bytes.length content - 1)) $ \n ->
            let made = either (length . explainTraceError) (\(_, events, _) -> length (shown events))
            in ioProperty (True <$ evaluate (made (parseTrace (changed n))))
    it "is read when it has fields that are not known" $
      fmap
        (\(_, events, _) -> events)
        (parseTrace (renderTrace header [] <> "{\"event\":\"lost\",\"colour\":[],\"count\":1}\n"))
        `shouldBe` Right [Lost 1]
    it "is read when its lines end as those of Windows do" $
      fmap
        (\(_, events, _) -> events)
        (parseTrace (Bytes.intercalate "\r\n" (Bytes.lines (renderTrace header detailed)) <> "\r\n"))
        `shouldBe` Right detailed
 where
  isNotANumber t = t /= t
  encodedLost = "{\"event\":\"lost\",\"count\":1}\n"

-- The first n bytes of the file: all complete events, and the rest is reported.
truncated :: [Event] -> Int64 -> Property
truncated events n = counterexample (show (n, content)) $ case parseTrace content of
  Left EmptyFile -> n === 0
  Left TornHeader -> property (Bytes.length (Bytes.takeWhile (/= '\n') whole) > n)
  Left other -> counterexample (show other) False
  Right (_, found, torn) ->
    let complete = fromIntegral (Bytes.count '\n' content) - 1
        -- The last line may lack only its newline.
        rest = last (Bytes.split '\n' content)
        isWhole = not (Bytes.null rest) && isRight (decodeEvent rest)
        expected = max 0 complete + (if isWhole then 1 else 0)
    in conjoin
        [ found === map replaced (take expected events)
        , torn
            === if Bytes.null rest || isWhole || complete < 0
              then Nothing
              else Just (TornLine (complete + 2) (fromIntegral (Bytes.length rest)))
        ]
 where
  whole = renderTrace header events
  content = Bytes.take n whole

problem :: Bytes.ByteString -> String
problem content = either explainTraceError (const "it was read") (parseTrace content)
