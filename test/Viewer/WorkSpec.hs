-- |
-- How much work each view takes: it is counted in bytes that are allocated, not in seconds.
module Viewer.WorkSpec (spec) where

import Control.Concurrent (threadDelay)
import Control.Concurrent.Async (race)
import Control.Exception (evaluate)
import Control.Monad (forM_, when, (>=>))
import qualified Data.ByteString.Lazy as Bytes
import Data.Int (Int64)
import Data.List (foldl')
import qualified Data.Text.Lazy as Text
import System.CPUTime (getCPUTime)
import System.Mem (getAllocationCounter, setAllocationCounter)
import Test.Hspec

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Diff
import Behavior.Trace.File
import Behavior.Trace.Otlp
import Behavior.Trace.Recording
import Behavior.Trace.Summary (renderSummary, summary)
import Behavior.Trace.Svg
import Behavior.Trace.Terminal.Live (nothingYet, watch)
import Behavior.Trace.Terminal.Screen (plain)
import Behavior.Trace.Terminal.Tree
import Behavior.Trace.TraceEvents
import Behavior.Trace.Tree
import Support (everywhere)
import Viewer.Examples

-- (What takes time but no memory is noticed by the watchdog.)
spec :: Spec
spec = around_ (race watchdog >=> either (const (expectationFailure "not over after 20 s of work")) pure) $ do
  isAll <- runIO everywhere
  let few = if isAll then 2000 else 1000
      many = if isAll then 100000 else 10000
  describe "Twice as many events take about twice as much work (if not four times)" . forM_ shapes $ \(shape, made) ->
    describe shape . forM_ views $ \(view, work) -> it view $ do
      -- (Logarithms make it a little more than two, and a buffer, of 32 KiB, is counted as a whole. What is
      -- quadratic takes more than that: at least 1,000 times 1,000 bytes.)
      [less, more] <- mapM (allocatedBy work . made) [few, 2 * few]
      fromIntegral more / fromIntegral (less + 2 * 32768) `shouldSatisfy` (< (2.5 :: Double))
  describe (show many ++ " spans in each other") . forM_ views $ \(view, work) ->
    it view $ evaluate (work (inEachOther many Named Succeeded)) >>= (`shouldSatisfy` (> 0))
  it (show many ++ " operators in each other leave the spans with names") $
    let drive = ended (many + 1) (Inside many) "drive" 0 Nothing 1 Succeeded
    in length (withoutOperators (inEachOther many Operator Succeeded ++ drive))
      `shouldBe` 4

-- Returns when the process has worked for 20 s from now on: on a busy machine that takes longer.
watchdog :: IO ()
watchdog = getCPUTime >>= \begun -> untilWorked (begun + 20 * 10 ^ (12 :: Int))
 where
  untilWorked end = getCPUTime >>= \t -> when (t < end) (threadDelay 100000 >> untilWorked end)

-- Events in which something is of this size.
shapes :: [(String, Int -> [Event])]
shapes =
  [ ("spans in each other", \n -> inEachOther n Named Succeeded)
  , ("spans in each other, all of which fail", \n -> inEachOther n Named (FailedWith "no"))
  , ("operators in each other", \n -> inEachOther n Operator Succeeded)
  , ( "spans in each other that one reaction stops"
    , \n -> inEachOther n Named (StoppedBy (SignalChanged (n + 1) [])) ++ [reaction (n + 1) 1]
    )
  , ( "spans in each other that each outlast the one around"
    , \n ->
        concat
          [ended k (outside k) "on" (fromIntegral k) Nothing (fromIntegral (n + k)) Succeeded | k <- [1 .. n]]
    )
  , ( "spans in each other, each with another one at the same time"
    , \n ->
        concat
          [ ended (2 * k - 1) (outer k) "on" (time k) Nothing (2 * time n - time k) Succeeded
              ++ ended (2 * k) (Inside (2 * k - 1)) "beside" (time k) Nothing (time (k + 2)) Succeeded
          | k <- [1 .. n `div` 2]
          ]
    )
  , ( "spans after each other"
    , \n -> concat [ended k Top "next" (time k) Nothing (time (k + 1)) Succeeded | k <- [1 .. n]]
    )
  , ("spans at the same time", sideBySide)
  , ("interruptions after each other", interrupted)
  , ("reactions", \n -> ended 1 Top "wait" 0 Nothing (time n) Succeeded ++ [reaction k 1 | k <- [2 .. n]])
  , ("spans in each other after a loss", \n -> Lost 1 : inEachOther n Named Succeeded)
  , ("losses", \n -> replicate n (Lost 1))
  ]
 where
  time = fromIntegral :: Int -> Seconds
  outer k = if k == 1 then Top else Inside (2 * k - 3)
  reaction k p =
    Reacted (Reaction k (Inside p) "monitor" (time k) [Change "battery" Nothing (show k)] (Just stopped) Nothing)
  stopped = StoppedBranch "task" 1 0 Succeeded

-- The outermost one has a name.
inEachOther :: Int -> SpanKind -> End -> [Event]
inEachOther n kind end = map Began spans ++ [Ended s (fromIntegral (2 * n - spanNumber s)) end | s <- reverse spans]
 where
  spans = [Span k (outside k) (if k == 1 then Named else kind) "on" (fromIntegral k) Nothing | k <- [1 .. n]]

outside :: Int -> Parent
outside k = if k == 1 then Top else Inside (k - 1)

-- Each makes all of what is shown, and counts it.
views :: [(String, [Event] -> Int64)]
views =
  [ ("the tree", size . renderTree . recording)
  , ("the summary", size . renderSummary . summary . recording)
  , ("the differences", \events -> let r = recording events in size (renderDifference (difference r r)))
  , ("the differences from nothing", size . renderDifference . difference (recording []) . recording)
  , ("the trace-event format", Bytes.length . renderTraceEvents . recording)
  , ("OTLP", Bytes.length . renderOtlp "Ann" header . recording)
  , ("the timeline", Text.length . timeline . recording)
  , ("the lines", size . concatMap plainLine)
  , ("the tree in the terminal", size . concatMap plain . treeLines 50 100 0 . foldl' watch nothingYet)
  , ("the file", either (const 0) (\(_, events, _) -> fromIntegral (length events)) . parseTrace . renderTrace header)
  , ("without operators", fromIntegral . length . show . withoutOperators)
  ]
 where
  size = fromIntegral . length

allocatedBy :: Show a => (a -> Int64) -> a -> IO Int64
allocatedBy work made = do
  _ <- evaluate (length (show made))
  setAllocationCounter 0
  _ <- evaluate (work made)
  negate <$> getAllocationCounter
