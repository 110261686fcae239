{-# LANGUAGE OverloadedStrings #-}

module Viewer.ToolSpec (spec) where

import Control.Monad (forM_, (>=>))
import qualified Data.ByteString.Lazy as Bytes
import Data.List (isInfixOf)
import qualified Data.Text.Lazy.Encoding as Text
import System.Exit (ExitCode (..))
import System.FilePath ((</>))
import Test.Hspec

import Behavior.Trace.Diff
import Behavior.Trace.File
import Behavior.Trace.Otlp
import Behavior.Trace.Recording
import Behavior.Trace.Summary
import Behavior.Trace.Svg
import Behavior.Trace.TraceEvents
import Behavior.Trace.Tree
import Temporary
import Tool
import Viewer.Examples

spec :: Spec
spec = around withMissions $ do
  it "prints the tree" $ \folder ->
    run [folder </> "mission", "--tree"] `shouldReturn` (ExitSuccess, renderTree (recording mission), "")
  it "prints the summary" $ \folder ->
    run [folder </> "mission", "--summary"]
      `shouldReturn` (ExitSuccess, renderSummary (summary (recording mission)), "")
  it "prints the differences" $ \folder ->
    run [folder </> "mission", "--diff", folder </> "mended"]
      `shouldReturn` (ExitSuccess, renderDifference (difference (recording mission) (recording mended)), "")
  it "writes the trace-event format" $ \folder -> do
    run [folder </> "mission", "--trace-events", folder </> "out"] `shouldReturn` (ExitSuccess, "", "")
    made <- Bytes.readFile (folder </> "out")
    made `shouldBe` renderTraceEvents (recording mission)
  it "writes OTLP, with the name of the file as that of the service" $ \folder -> do
    Bytes.writeFile (folder </> "Ann.jsonl") (renderTrace header mission)
    run [folder </> "Ann.jsonl", "--otlp", folder </> "out"] `shouldReturn` (ExitSuccess, "", "")
    made <- Bytes.readFile (folder </> "out")
    made `shouldBe` renderOtlp "Ann" header (recording mission)
  it "draws the timeline" $ \folder -> do
    run [folder </> "mission", "--svg", folder </> "out.svg"] `shouldReturn` (ExitSuccess, "", "")
    made <- Bytes.readFile (folder </> "out.svg")
    made `shouldBe` Text.encodeUtf8 (timeline (recording mission))
  it "does not replace the trace by what it makes of it" $ \folder -> do
    forM_ ["--trace-events", "--otlp", "--svg"] $ \option ->
      run [folder </> "mission", option, folder </> "." </> "mission"] >>= failsWith "this is the file of the trace"
    content <- Bytes.readFile (folder </> "mission")
    content `shouldBe` renderTrace header mission
  it "reports an incomplete last line, and shows the rest" $ \folder -> do
    Bytes.writeFile (folder </> "torn") (renderTrace header mission <> "{\"ev")
    (status, printed, remarks) <- run [folder </> "torn", "--tree"]
    (status, printed) `shouldBe` (ExitSuccess, renderTree (recording mission))
    remarks `shouldSatisfy` isInfixOf (": line " ++ show (length mission + 2) ++ ": incomplete (4 bytes)")
  it "reports the line of a damaged file, of either side, with status 2" $ \folder -> do
    Bytes.writeFile (folder </> "damaged") (renderTrace header mission <> "{\"ev\n" <> renderTrace header mission)
    forM_ ["--tree", "--summary"] $ \mode ->
      run [folder </> "damaged", mode] >>= failsWith (": line " ++ show (length mission + 2) ++ ": ")
    run [folder </> "mission", "--diff", folder </> "damaged"]
      >>= failsWith ("damaged: line " ++ show (length mission + 2) ++ ": ")
  it "reports what is no trace, with status 2" $ \folder ->
    forM_
      [ ("", "line 1: the file is empty")
      , ("hello", "line 1: this is no trace")
      , ("{\"format\":\"behavior-trace\",\"version\":2}\n", "line 1: version 2")
      ]
      $ \(content, why) -> do
          Bytes.writeFile (folder </> "other") content
          run [folder </> "other", "--tree"] >>= failsWith why
  it "reports a file that cannot be read or written, with status 2" $ \folder -> do
    run [folder </> "none", "--tree"] >>= failsWith "none"
    run [folder, "--tree"] >>= failsWith folder
    forM_ ["--trace-events", "--otlp", "--svg"] $ \option ->
      run [folder </> "mission", option, folder </> "none" </> "out"] >>= failsWith "out"
  it "shows no page of what is no trace, with status 2" $ \folder -> do
    run [folder </> "none", "--live"] >>= failsWith "none"
    Bytes.writeFile (folder </> "other") "hello\n"
    run [folder </> "other", "--live"] >>= failsWith "other: line 1: this is no trace"
  it "refuses other options, with status 2" $ \folder ->
    forM_
      [ []
      , ["--tree"]
      , [folder </> "mission"]
      , [folder </> "mission", "--tree", "--summary"]
      , [folder </> "mission", "--picture"]
      , [folder </> "mission", "--hub", "Ann=http://127.0.0.1:8420/"]
      ]
      $ run >=> failsWith "Usage: behavior-trace"
  it "refuses to show robots without names and addresses, with status 2" $ \_ ->
    forM_ ["Ann", "http://127.0.0.1:8420/", "Ann=127.0.0.1:8420"] $ \robot ->
      run ["--hub", robot] >>= failsWith "NAME=http://HOST:PORT/"
  it "explains its options" $ \_ -> do
    (status, printed, _) <- run ["--help"]
    status `shouldBe` ExitSuccess
    let options = ["--tree", "--summary", "--svg OUT", "--trace-events OUT", "--otlp OUT", "--diff OTHER", "--live"]
    forM_ (options ++ ["--hub NAME=ADDRESS"]) $ \option -> printed `shouldSatisfy` isInfixOf option
 where
  failsWith why (status, printed, remarks) = do
    (status, printed) `shouldBe` (ExitFailure 2, "")
    remarks `shouldSatisfy` isInfixOf why

-- With a folder that has the two missions.
withMissions :: (FilePath -> IO a) -> IO a
withMissions use = inFolder $ \folder -> do
  Bytes.writeFile (folder </> "mission") (renderTrace header mission)
  Bytes.writeFile (folder </> "mended") (renderTrace header mended)
  use folder
