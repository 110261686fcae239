-- |
-- Showing what a behaviour does, while it runs and afterwards: one call for a program's @main@.
--
-- > main = runBehavior (viewing defaultViewing {timelineFile = Just "run.svg"} mission)
--
-- The other modules here have the parts: "Behavior.Trace.File", "Behavior.Trace.Svg",
-- "Behavior.Trace.Terminal", and texts.
module Behavior.Trace.Viewing
  ( Viewing (..)
  , defaultViewing
  , viewing
  , viewEvents
  ) where

import Control.Applicative ((<|>))
import Control.Exception (IOException, catch, mask, onException, throwIO, try)
import Control.Monad (when)
import qualified Data.ByteString.Lazy as Bytes
import Data.Foldable (for_, traverse_)
import Data.IORef (modifyIORef', newIORef, readIORef, writeIORef)
import Data.Text.Lazy.Encoding (encodeUtf8)
import Data.Time.Clock.POSIX (posixSecondsToUTCTime)
import System.IO (hPutStrLn, stderr, stdout)

import Behavior (Behavior)
import Behavior.Trace
import Behavior.Trace.File (Header (..), renderTrace, withTraceFile)
import Behavior.Trace.Recording (recording, withoutOperators)
import Behavior.Trace.Svg (timeline)
import Behavior.Trace.Terminal (withTerminal)
import Behavior.Trace.Tree (renderTree)

-- | What is shown of a trace.
--
-- @since 0.1.0.0
data Viewing = Viewing
  { traceFile :: Maybe FilePath
  -- ^ The file to which its events are written while it is made ("Behavior.Trace.File").
  , timelineFile :: Maybe FilePath
  -- ^ The SVG file that is written at its end ("Behavior.Trace.Svg"). Until then its events are kept
  -- in memory.
  , liveTree :: Bool
  -- ^ Whether what runs is shown in the terminal ("Behavior.Trace.Terminal"), on the standard
  -- output.
  }
  deriving (Eq, Show)

-- | Shows nothing.
--
-- @since 0.1.0.0
defaultViewing :: Viewing
defaultViewing = Viewing {traceFile = Nothing, timelineFile = Nothing, liveTree = False}

-- | Runs a behaviour in a trace ('withTrace'), and shows it.
--
-- [Result, failure, fault, cancellation] Those of the behaviour. The files are written however it ends,
--   also by SIGINT, SIGTERM or SIGHUP under 'Behavior.runBehavior'.
-- [Fault] If a file cannot be created or written, the behaviour runs nevertheless; when it has returned, this
--   throws the 'IOException', which names the file. (Of two files, one is reported on @stderr@.) If the
--   behaviour throws, that goes on, and all such files are reported on @stderr@.
--
-- @since 0.1.0.0
viewing :: Viewing -> Behavior a -> Behavior a
viewing v act =
  toFile $ \file -> toTimeline $ \kept -> toTerminal $ \tree -> withTrace (map Batches (file ++ kept ++ tree)) act
 where
  toFile use = maybe (use []) (`toTraceFile` use) (traceFile v)
  toTerminal use = if liveTree v then withTerminal stdout (use . pure) else use []
  toTimeline use = case timelineFile v of
    Nothing -> use []
    Just path -> do
      seen <- newIORef []
      use [\batch -> modifyIORef' seen (batch :)] `andThen` (readIORef seen >>= writeTimeline path . concat . reverse)

-- The function that adds events to the file; none if it cannot be created.
toTraceFile :: FilePath -> ([[Event] -> IO ()] -> IO a) -> IO a
toTraceFile path use = do
  created <- newIORef False
  result <- try . withTraceFile path $ \write -> writeIORef created True >> untilItFails write (use . pure)
  wasCreated <- readIORef created
  case result of
    Right a -> pure a
    Left e
      | wasCreated -> throwIO (e :: IOException)
      | otherwise -> use [] `andThen` throwIO e

-- With a function that does not throw. What the first call threw that failed is thrown at the end.
untilItFails :: ([Event] -> IO ()) -> (([Event] -> IO ()) -> IO a) -> IO a
untilItFails write use = do
  failed <- newIORef Nothing
  use (\batch -> write batch `catch` \e -> modifyIORef' failed (<|> Just (e :: IOException)))
    `andThen` (readIORef failed >>= traverse_ throwIO)

-- | Shows the events of a run that is over, that of a simulation for example: of named spans
-- only, as 'viewing' does. The times of the file are those of the events, from the beginning of 1970 on: so equal
-- runs give equal files.
--
-- > found <- tryExplore plan property
-- > either (viewEvents defaultViewing {timelineFile = Just "counterexample.svg"} . failingEvents) print found
--
-- @since 0.1.0.0
viewEvents :: Viewing -> [Event] -> IO ()
viewEvents v events =
  when (liveTree v) (putStr (renderTree (recording shown)))
    `andThen` for_ (timelineFile v) (`writeTimeline` shown)
    `andThen` for_ (traceFile v) (`Bytes.writeFile` renderTrace (Header (posixSecondsToUTCTime 0)) shown)
 where
  shown = withoutOperators events

writeTimeline :: FilePath -> [Event] -> IO ()
writeTimeline path = Bytes.writeFile path . encodeUtf8 . timeline . recording

-- 'finally', except that an 'IOException' of the second action does not replace what the first one threw: it is
-- reported on @stderr@.
andThen :: IO a -> IO () -> IO a
andThen act end = mask $ \restore -> (restore act `onException` reportingErrors end) <* end

reportingErrors :: IO () -> IO ()
reportingErrors act = try act >>= either (\e -> hPutStrLn stderr ("viewing: " ++ show (e :: IOException))) pure
