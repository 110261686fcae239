module Main (main) where

import Test.Hspec

import Support (sampling)
import qualified Viewer.DiffSpec
import qualified Viewer.FileSpec
import qualified Viewer.FormatSpec
import qualified Viewer.InterruptionSpec
import qualified Viewer.OtlpSpec
import qualified Viewer.OutputSpec
import qualified Viewer.PictureSpec
import qualified Viewer.PlainLinesSpec
import qualified Viewer.RecordingSpec
import qualified Viewer.SimulatedSpec
import qualified Viewer.SummarySpec
import qualified Viewer.SvgSpec
import qualified Viewer.TerminalSpec
import qualified Viewer.TextSpec
import qualified Viewer.ToolSpec
import qualified Viewer.TraceEventsSpec
import qualified Viewer.TreeSpec
import qualified Viewer.ViewingSpec
import qualified Viewer.WorkSpec

main :: IO ()
main = hspec . sampling 100 $ do
  describe "The file of a trace" $ do
    Viewer.FileSpec.spec
    Viewer.FormatSpec.spec
  describe "An event as a line of text" Viewer.PlainLinesSpec.spec
  describe "A recording" Viewer.RecordingSpec.spec
  describe "The tree" Viewer.TreeSpec.spec
  describe "The tree in the terminal" Viewer.TerminalSpec.spec
  describe "What a program prints while the tree is in the terminal" Viewer.OutputSpec.spec
  describe "The timeline" $ do
    Viewer.SvgSpec.spec
    Viewer.PictureSpec.spec
  describe "An interruption" Viewer.InterruptionSpec.spec
  describe "The summary" Viewer.SummarySpec.spec
  describe "The differences" Viewer.DiffSpec.spec
  describe "The trace-event format" Viewer.TraceEventsSpec.spec
  describe "OTLP" Viewer.OtlpSpec.spec
  describe "A simulated run" Viewer.SimulatedSpec.spec
  describe "Texts of others" Viewer.TextSpec.spec
  describe "Viewing" Viewer.ViewingSpec.spec
  describe "behavior-trace" Viewer.ToolSpec.spec
  describe "Work" Viewer.WorkSpec.spec
