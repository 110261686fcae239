-- |
-- A trace in the terminal, while it happens.
module Behavior.Trace.Terminal
  ( withTerminal
  ) where

import Control.Concurrent (forkIOWithUnmask)
import Control.Concurrent.MVar
import Control.Exception (IOException, SomeException, bracket, catch, finally, mask)
import Control.Monad (when)
import qualified Data.ByteString as Bytes
import Data.IORef
import Data.List (foldl', isPrefixOf)
import Data.Maybe (isNothing)
import qualified Data.Text as Text
import Data.Text.Encoding (decodeUtf8With)
import Data.Text.Encoding.Error (lenientDecode)
import GHC.Clock (getMonotonicTime)
import GHC.IO.Handle (hDuplicate)
import System.Console.ANSI (hSupportsANSI)
import System.Console.Terminal.Size (Window (..), hSize)
import System.Environment (lookupEnv)
import System.IO
import System.Timeout (timeout)

import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Terminal.Live
import Behavior.Trace.Terminal.Output
import Behavior.Trace.Terminal.Screen
import Behavior.Trace.Terminal.Tree

-- | Shows the events that the function gets, in the terminal: a tree of what runs, redrawn in place
-- at most ten times a second. At the end the last tree stays.
--
-- What the program prints meanwhile on the standard output or the standard error appears above the tree, whole and in
-- order: also by foreign code, and by processes that it starts. A line that is not complete is the first line of the
-- tree until it is. (All these write into a pipe, and so they see no terminal. If the program is killed by SIGKILL,
-- what was in the pipe is lost. In a program without @-threaded@, and on Windows, output disturbs the tree.)
--
-- If the handle is no terminal, each event is written as a line of text.
--
-- There are no colours if @NO_COLOR@ is set. The events come from one thread.
--
-- @since 0.1.0.0
withTerminal :: Handle -> (([Event] -> IO ()) -> IO a) -> IO a
withTerminal h use = do
  encoding <- hGetEncoding h
  let safe = if maybe False (("UTF" `isPrefixOf`) . show) encoding then id else inAscii
  live <- hSupportsANSI h
  if live
    then bracket (hDuplicate h) (\terminal -> hClose terminal `catch` noTerminal) $ \terminal -> do
      mapM_ (hSetEncoding terminal) encoding
      hSetBuffering terminal (BlockBuffering Nothing)
      redrawn terminal safe use
    else use (\events -> mapM_ (hPutStrLn h . safe . plainLine) events *> hFlush h)

-- (It may be gone.)
noTerminal :: IOException -> IO ()
noTerminal _ = pure ()

-- What is on the screen below the lines that were printed: the tree, and above it the line that is not complete. If
-- that is too long, it has been printed as far as it is known, and there is no tree until it ends.
data Shown = Shown
  { shownTree :: [Line]
  , incomplete :: !Bytes.ByteString
  , isOpen :: !Bool
  , linesDrawn :: !Int
  }

redrawn :: Handle -> (String -> String) -> (([Event] -> IO ()) -> IO a) -> IO a
redrawn h safe use = do
  colours <- maybe True null <$> lookupEnv "NO_COLOR"
  state <- newIORef (nothingYet, 0)
  screen <- newMVar (Shown [] Bytes.empty False 0)
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
        onScreen $ \s ->
          if tree == shownTree s || isNothing (liveTime live) then pure s else redraw s {shownTree = tree}
      onScreen f = modifyMVar_ screen (\s -> f s <* hFlush h)
      redraw s
        | isOpen s = pure s
        | otherwise = do
            (rows, wide) <- windowSize h
            let partial = [[(Normal, cutTo wide (lastPart (incomplete s)))] | not (Bytes.null (incomplete s))]
                below = take rows (partial ++ shownTree s)
            hPutStr h (frame colours safe (linesDrawn s) below)
            pure s {linesDrawn = length below}
      erase s
        | linesDrawn s == 0 = pure s
        | otherwise = s {linesDrawn = 0} <$ hPutStr h (frame colours safe (linesDrawn s) [])
      printed piece = onScreen $ \s ->
        let (whole, rest) = Bytes.breakEnd (== 10) (incomplete s <> piece)
            tooLong = isOpen s && Bytes.null whole || Bytes.length rest > 65536
            (now, later) = if tooLong then (whole <> rest, Bytes.empty) else (whole, rest)
         in if Bytes.null now
              then redraw s {incomplete = later}
              else do
                s' <- erase s
                Bytes.hPut h now
                redraw s' {incomplete = later, isOpen = tooLong}
      -- The line that is not complete goes on below the tree.
      leave = onScreen $ \s -> do
        when (isOpen s) (hPutStr h "\n")
        s' <- redraw s {incomplete = Bytes.empty, isOpen = False}
        s' {linesDrawn = 0} <$ Bytes.hPut h (incomplete s)
      loop = do
        draw
        ended <- timeout 100000 (readMVar stop)
        if isNothing ended then loop else draw
  withOutputTo printed (showing loop stop stopped (use receive)) `finally` (leave `catch` noTerminal)
 where
  showing loop stop stopped act = mask $ \restore -> do
    _ <- forkIOWithUnmask $ \unmask -> (unmask loop `catch` anything) `finally` putMVar stopped ()
    restore act `finally` (putMVar stop () *> takeMVar stopped)
  anything :: SomeException -> IO ()
  anything _ = pure ()

-- What a terminal shows of an incomplete line: what comes after the last carriage return.
lastPart :: Bytes.ByteString -> String
lastPart = inert . Text.unpack . decodeUtf8With lenientDecode . Bytes.takeWhileEnd (/= 13)

-- The lines and columns to use. The last line is for the cursor, the last column stays free: at
-- the end of a full line some terminals go to the next one.
windowSize :: Handle -> IO (Int, Int)
windowSize h = do
  size <- hSize h
  pure $ case size of
    Just (Window rows wide) | rows > 0, wide > 0 -> (max 1 (rows - 1), max 1 (wide - 1))
    _ -> (23, 79)
