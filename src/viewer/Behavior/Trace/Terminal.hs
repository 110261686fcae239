-- |
-- A trace in the terminal, while it happens.
module Behavior.Trace.Terminal
  ( withTerminal

    -- * The state, and what is shown of it
  , Live
  , nothingYet
  , watch
  , treeLines
  , frame

    -- * Lines
  , Line
  , Paint (..)
  , plain
  , painted
  , columns
  ) where

import Control.Concurrent (forkIOWithUnmask)
import Control.Concurrent.MVar
import Control.Exception (IOException, SomeException, catch, finally, mask)
import Control.Monad (unless)
import Data.IORef
import Data.List (foldl', isPrefixOf)
import Data.Maybe (isNothing)
import GHC.Clock (getMonotonicTime)
import System.Console.ANSI
import System.Console.Terminal.Size (Window (..), hSize)
import System.Environment (lookupEnv)
import System.IO
import System.Timeout (timeout)

import Behavior.Trace
import Behavior.Trace.Terminal.Live
import Behavior.Trace.Terminal.Screen
import Behavior.Trace.Terminal.Tree

-- | Shows the events that the function gets, in the terminal: a tree of what runs, redrawn in place
-- at most ten times a second. At the end the last tree stays.
--
-- If the handle is no terminal, each event is written as a line of text.
--
-- The window belongs to the tree: other output in between disturbs it. There are no colours if
-- @NO_COLOR@ is set. The events come from one thread.
--
-- @since 0.1.0.0
withTerminal :: Handle -> (([Event] -> IO ()) -> IO a) -> IO a
withTerminal h use = do
  unicode <- maybe False (("UTF" `isPrefixOf`) . show) <$> hGetEncoding h
  let safe = if unicode then id else inAscii
  live <- hSupportsANSI h
  if live
    then redrawn h safe use
    else use (\events -> mapM_ (hPutStrLn h . safe . plainLine) events *> hFlush h)

redrawn :: Handle -> (String -> String) -> (([Event] -> IO ()) -> IO a) -> IO a
redrawn h safe use = do
  colours <- maybe True null <$> lookupEnv "NO_COLOR"
  state <- newIORef (nothingYet, 0)
  shown <- newIORef []
  stop <- newEmptyMVar
  stopped <- newEmptyMVar
  let receive events = do
        arrived <- getMonotonicTime
        (live, _) <- readIORef state
        let live' = foldl' watch live events
        live' `seq` writeIORef state (live', arrived)
      -- The clock of the events may be another one: what counts is the real time since the last event.
      draw = do
        (live, arrived) <- readIORef state
        present <- getMonotonicTime
        (rows, wide) <- windowSize h
        let time = maybe 0 (+ realToFrac (present - arrived)) (liveTime live)
            tree = treeLines rows wide time live
        before <- readIORef shown
        unless (tree == before || isNothing (liveTime live)) $ do
          hPutStr h (frame colours safe (length before) tree)
          hFlush h
          writeIORef shown tree
      loop = do
        draw
        ended <- timeout 100000 (readMVar stop)
        if isNothing ended then loop else draw
  mask $ \restore -> do
    ignoring (hHideCursor h)
    _ <- forkIOWithUnmask $ \unmask ->
      (unmask loop `catch` anything) `finally` putMVar stopped ()
    restore (use receive)
      `finally` (putMVar stop () *> takeMVar stopped)
      `finally` ignoring (hShowCursor h *> hFlush h)
 where
  -- (The terminal may be gone.)
  ignoring act = act `catch` \e -> let _ = e :: IOException in pure ()
  anything :: SomeException -> IO ()
  anything _ = pure ()

-- The lines and columns to use. The last line is for the cursor, the last column stays free: at
-- the end of a full line some terminals go to the next one.
windowSize :: Handle -> IO (Int, Int)
windowSize h = do
  size <- hSize h
  pure $ case size of
    Just (Window rows wide) | rows > 0, wide > 0 -> (max 1 (rows - 1), max 1 (wide - 1))
    _ -> (23, 79)

-- | What is written to replace the frame before, of that number of lines, by these lines. The other
-- arguments say whether there are colours, and what the terminal's encoding makes of a text.
--
-- @since 0.1.0.0
frame :: Bool -> (String -> String) -> Int -> [Line] -> String
frame colours safe above tree = up ++ concatMap one tree ++ clearFromCursorToScreenEndCode
 where
  up = if above > 0 then cursorUpLineCode above else "\r"
  one line = text [(p, safe t) | (p, t) <- line] ++ clearFromCursorToLineEndCode ++ "\n"
  text = if colours then painted else plain
