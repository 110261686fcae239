{-# LANGUAGE OverloadedStrings #-}

-- |
-- A trace file on a live page. (Each example looks at the file when it has written to it: a gate lets the page look.)
module Live.FollowingSpec (spec) where

import Control.Concurrent.Async (Async, concurrently_, wait, waitSTM, withAsync)
import Control.Concurrent.STM
import Control.Exception (IOException, try)
import Control.Monad (forM_, void, when, (>=>))
import qualified Data.ByteString.Lazy as Bytes
import Data.List (isInfixOf, isPrefixOf, sort)
import Data.Text (Text)
import Data.Time.Clock (addUTCTime, getCurrentTime)
import qualified Network.WebSockets as Websockets
import System.Directory (removeFile)
import System.Timeout (timeout)
import Test.Hspec hiding (after, before)

import Behavior.Live
import Behavior.Live.Internal.Following
import Behavior.Trace
import Behavior.Trace.File
import Live.Reader
import Temporary
import Viewer.Examples (header, mended, mission, sideBySide)

spec :: Spec
spec = around_ (timeout 60000000 >=> maybe (expectationFailure "not over after 60 s") pure) $ do
  it "is shown with its own name, zero and times, as it is" $ showing [renderTrace header mission] $ \port _ _ _ ->
    reading port plainly $ \connection -> do
      hello <- next connection
      (field "robot" hello, field "zero" hello) `shouldBe` ("Ann.jsonl" :: Text, "2026-01-31T12:00:00Z" :: Text)
      known connection (length mission) `shouldReturn` state mission
      timeNow connection `shouldReturn` 40
  it "is shown whole to a reader that comes late" $ do
    let many = sideBySide 1000
    showing [renderTrace header many] $ \port _ _ _ -> do
      -- (When the first one has it all, the second one comes late.)
      _ <- shownAt port (length many)
      shownAt port (length many) `shouldReturn` state many
  it "is followed while it is written, also within a line; then it is the time of day" $ do
    begun <- addUTCTime (-100) <$> getCurrentTime
    let (before, after) = splitAt 9 (filter (not . isLost) mission)
        (half, rest) = Bytes.splitAt 20 (added after)
    showing [renderTrace (Header begun) before, half] $ \port path looks _ ->
      reading port plainly $ \connection -> do
        _ <- next connection
        known connection 9 `shouldReturn` state before
        timeNow connection `shouldReturn` 7
        Bytes.appendFile path (Bytes.take 30 rest)
        looks
        Bytes.appendFile path (Bytes.drop 30 rest)
        looks
        events connection (length after) `shouldReturn` after
        timeNow connection >>= (`shouldSatisfy` (\t -> t >= 100 && t < 160))
        let ends = [Ended s 41 Succeeded | Began s <- state (filter (not . isLost) mission)]
        Bytes.appendFile path (added ends)
        looks
        events connection (length ends) `shouldReturn` ends
        timeNow connection `shouldReturn` 41
  it "makes place for that of another run, which may have the same header" . forM_ runs $ \(isGone, zero, others) ->
    showing [renderTrace header mission] $ \port path looks _ -> do
      first <- reading port plainly $ \connection -> do
        hello <- next connection
        known connection (length mission) `shouldReturn` state mission
        -- (What was there is shown until there is another one.)
        when isGone (removeFile path >> looks)
        concurrently_ (untilOver connection) $ do
          Bytes.writeFile path (renderTrace (Header (addUTCTime zero (zeroTime header))) others)
          looks
        pure (field "run" hello :: Text)
      reading port plainly $ \connection -> do
        hello <- next connection
        field "zero" hello `shouldBe` (if zero == 60 then "2026-01-31T12:01:00Z" else "2026-01-31T12:00:00Z" :: Text)
        field "run" hello `shouldNotBe` first
        known connection (length others) `shouldReturn` state others
  it "is waited for while it is empty, or has half a header" $
    showing [renderTrace header mission] $ \port path looks _ -> do
      forM_ ["", Bytes.take 20 (renderTrace header [])] $ \content -> Bytes.writeFile path content >> looks
      Bytes.writeFile path (renderTrace header mended)
      looks
      shownAt port (length mended) `shouldReturn` state mended
  it "may have lines of any length" $ do
    let long = finished 1 (replicate 3000000 'x') : [finished n "short" | n <- [2 .. 10]]
        finished n name = Ended (Span n Top Named name 0 Nothing) 1 Succeeded
    showing [renderTrace header long] $ \port _ _ _ ->
      fmap length (shownAt port 10) `shouldReturn` 10
  it "is shown until a line is damaged, which is reported with its number" $
    showing [renderTrace header mission] $ \_ path looks shown -> do
      Bytes.appendFile path (added mission)
      looks
      Bytes.appendFile path (added [Lost 1] <> "{}\n")
      looks
      wait shown >>= (`shouldSatisfy` isInfixOf ("Ann.jsonl: line " ++ show (2 * length mission + 3)))
  it "is refused if it is none of a trace" . inFolder $ \folder ->
    forM_ [("", "line 1: the file is empty"), ("hello\n", "line 1: this is no trace"), ("{\"format\":", "line 1: ")] $
      \(content, why) -> do
        Bytes.writeFile (folder ++ "/file") content
        showFile (fail "it waits") loopback {pagePort = 0} (folder ++ "/file") >>= (`shouldSatisfy` isInfixOf why)
  it "is not shown if it is not there" . withPath $ \path ->
    (try (showFile (fail "it waits") loopback {pagePort = 0} path) :: IO (Either IOException String))
      >>= (`shouldSatisfy` either (isPrefixOf path . show) (const False))
  it "is not shown if there is no page, which is reported" . withPath $ \path -> do
    Bytes.writeFile path (renderTrace header mission)
    showFile (fail "it waits") loopback {pagePort = -1} path
      >>= (`shouldSatisfy` isPrefixOf "live page: no page: pagePort")
 where
  isLost event = case event of
    Lost _ -> True
    _ -> False
  added = Bytes.tail . Bytes.dropWhile (/= 10) . renderTrace header
  runs = [(True, 60, mended), (False, 60, sideBySide 100), (False, 0, sideBySide 100)]
  untilOver connection = next connection >>= \m -> if message m == "over" then pure () else untilOver connection

-- | Shows a file with these contents, from when the page has looked at it. The action is given the page's port, the
-- file's path, what lets the page look again, and what shows it.
showing :: [Bytes.ByteString] -> (Int -> FilePath -> IO () -> Async String -> IO a) -> IO a
showing contents use = inFolder $ \folder -> do
  port <- freePort
  let path = folder ++ "/Ann.jsonl"
  Bytes.writeFile path (mconcat contents)
  (waits, goesOn) <- (,) <$> newEmptyTMVarIO <*> newEmptyTMVarIO
  let pause = atomically (putTMVar waits ()) >> atomically (takeTMVar goesOn)
  withAsync (showFile pause loopback {pageRobot = "Ann.jsonl", pagePort = port} path) $ \shown -> do
    let orOver act = atomically (act `orElse` void (waitSTM shown))
    orOver (takeTMVar waits)
    use port path (atomically (putTMVar goesOn ()) >> orOver (takeTMVar waits)) shown

-- | What someone knows of events: those of spans that have ended, of reactions, and of spans that run.
state :: [Event] -> [Event]
state them = sort ([e | e@Ended {} <- them] ++ [e | e@Reacted {} <- them] ++ running)
 where
  running = [e | e@(Began s) <- them, null [() | Ended t _ _ <- them, spanNumber t == spanNumber s]]

-- | What a reader knows when it has received this number of events, or a snapshot in place of them.
known :: Websockets.Connection -> Int -> IO [Event]
known connection n = go []
 where
  go before = do
    m <- next connection
    let fields = if message m == "snapshot" then ["ended", "reacted", "running"] else ["events"]
        more = concatMap (`eventsIn` m) fields
    if field "next" m >= n then pure (state (before ++ more)) else go (before ++ more)

-- | The same of a reader that comes now.
shownAt :: Int -> Int -> IO [Event]
shownAt port n = reading port plainly $ \connection -> next connection >> known connection n

-- | The time of the next beat but one: the first may be from before.
timeNow :: Websockets.Connection -> IO Double
timeNow connection = beat >> beat
 where
  beat = nextOfAny connection >>= \m -> if message m == "beat" then pure (field "now" m) else beat
