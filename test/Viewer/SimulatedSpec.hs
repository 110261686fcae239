-- | What is made of the events of two simulated runs.
module Viewer.SimulatedSpec (spec) where

import Control.Exception (IOException, catch, throwIO)
import Control.Monad (forever)
import Data.List (foldl')
import Test.Hspec hiding (after)

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Time
import Behavior.Trace
import Behavior.Trace.Diff
import Behavior.Trace.File
import Behavior.Trace.Otlp
import Behavior.Trace.Recording
import Behavior.Trace.Summary
import Behavior.Trace.Svg
import Behavior.Trace.Terminal.Live (nothingYet, watch)
import Behavior.Trace.Terminal.Screen (plain)
import Behavior.Trace.Terminal.Tree
import Behavior.Trace.TraceEvents
import Behavior.Trace.Tree
import Viewer.Examples (header)
import Viewer.Golden

spec :: Spec
spec = do
  low <- runIO (events <$> simulate (greenhouse 50))
  full <- runIO (events <$> simulate (greenhouse 100))
  let shown = recording (withoutOperators low)
  golden "simulated.jsonl" (renderTrace header low)
  goldenText "simulated-lines.txt" (unlines (map plainLine low))
  goldenText "simulated-tree.txt" (renderTree (recording low))
  let beforeIt = takeWhile (not . hasEnded "recharge") (withoutOperators low)
  goldenText "simulated-terminal.txt" (unlines (map plain (treeLines 30 100 20 (foldl' watch nothingYet beforeIt))))
  goldenText "simulated-summary.txt" (renderSummary (summary shown))
  goldenText "simulated-diff.txt" (renderDifference (difference shown (recording (withoutOperators full))))
  golden "simulated-trace-events.json" (renderTraceEvents shown)
  golden "simulated-otlp.json" (renderOtlp "greenhouse" header (recording low))
  goldenSvg "simulated-timeline.svg" (timeline shown)
 where
  hasEnded name event = case event of
    Ended s _ _ -> spanName s == name
    _ -> False

-- | A robot waters three beds, with so much charge. It meets a locked door, a time limit, the slower
-- of two sensors, and a fault.
greenhouse :: Int -> Behavior ()
greenhouse charge = do
  battery <- newTVarIO charge
  let level = Signal.named "battery" (Signal.watching (readTVar battery))
      drain = forever (sleep 1 >> atomically (modifyTVar' battery (subtract 2)))
      recharge = named "recharge" (sleep 8 >> atomically (writeTVar battery 100))
      bed n = named ("water bed " ++ show n) (sleep 4.5)
  named "mission" $
    drain ||| do
      named "enter" (named "front door" (sleep 1 >> failWith "locked") ? named "back door" (sleep 2))
      Signal.monitor
        (Signal.named "battery low" ((< 20) <$> level))
        recharge
        (named "water" (mapM_ bed [1 .. 3 :: Int]))
      timeout 2 (named "photograph" (sleep 5)) ? pure ()
      firstOf [named "camera" (sleep 3600), named "lidar" (sleep 0.5)]
      named "upload" (throwIO (userError "no radio")) `catch` goOn where
  goOn :: IOException -> Behavior ()
  goOn _ = pure ()
