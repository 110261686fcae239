-- |
-- Showing what a behaviour does, while it runs and afterwards: one call for a program's @main@.
--
-- > main = runBehavior (viewing nothing {timelineFile = Just "run.svg"} mission)
--
-- The other modules here have the parts: "Behavior.Trace.File", "Behavior.Trace.Svg",
-- "Behavior.Trace.Terminal", and texts.
module Behavior.Trace.Viewing
  ( Viewing (..)
  , nothing
  , viewing
  , viewEvents
  ) where

import Control.Exception (IOException, finally, try)
import Control.Monad (when)
import Data.Foldable (for_)
import Data.IORef (modifyIORef', newIORef, readIORef)
import qualified Data.ByteString.Lazy as Bytes
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
nothing :: Viewing
nothing = Viewing {traceFile = Nothing, timelineFile = Nothing, liveTree = False}

-- | Runs a behaviour in a trace ('withTrace'), and shows it.
--
-- [Result, failure, fault, cancellation] Those of the behaviour. The files are written however it ends,
--   also by SIGINT or SIGTERM under 'Behavior.runBehavior'.
-- [Files] One that cannot be created is an 'IOException', before the behaviour starts. One that
--   cannot be written later is reported on @stderr@: the behaviour goes on.
--
-- @since 0.1.0.0
viewing :: Viewing -> Behavior a -> Behavior a
viewing v act = toFile $ \file -> toTimeline $ \kept -> toTerminal $ \tree -> withTrace (map Batches (file ++ kept ++ tree)) act
 where
  toFile use = maybe (use []) (\path -> withTraceFile path (use . pure)) (traceFile v)
  toTerminal use = if liveTree v then withTerminal stdout (use . pure) else use []
  toTimeline use = case timelineFile v of
    Nothing -> use []
    Just path -> do
      Bytes.writeFile path Bytes.empty
      seen <- newIORef []
      use [\batch -> modifyIORef' seen (batch :)] `finally` (readIORef seen >>= reportingErrors . writeTimeline path . concat . reverse)

-- | Shows the events of a run that is over, that of a simulation for example: of named spans
-- only, as 'viewing' does. The times of the file are those of the events, from the beginning of 1970 on: so equal
-- runs give equal files.
--
-- > found <- tryExplore plan property
-- > either (viewEvents nothing {timelineFile = Just "counterexample.svg"} . failingEvents) print found
--
-- @since 0.1.0.0
viewEvents :: Viewing -> [Event] -> IO ()
viewEvents v events = do
  for_ (traceFile v) $ \path -> Bytes.writeFile path (renderTrace (Header (posixSecondsToUTCTime 0)) shown)
  for_ (timelineFile v) (`writeTimeline` shown)
  when (liveTree v) (putStr (renderTree (recording shown)))
 where
  shown = withoutOperators events

writeTimeline :: FilePath -> [Event] -> IO ()
writeTimeline path = Bytes.writeFile path . encodeUtf8 . timeline . recording

reportingErrors :: IO () -> IO ()
reportingErrors act = try act >>= either (\e -> hPutStrLn stderr ("viewing: " ++ show (e :: IOException))) pure
