{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- A trace file on a live page, also while its program writes it.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Following
  ( showFile
  ) where

import Control.Concurrent.STM
import Control.Exception (handleJust)
import Control.Monad (guard)
import qualified Data.ByteString as Bytes
import qualified Data.ByteString.Char8 as Char8
import qualified Data.ByteString.Lazy as Lazy
import Data.Time.Clock (diffUTCTime, getCurrentTime)
import System.IO
import System.IO.Error (isDoesNotExistError)

import Behavior.Internal.Core.Seconds (Seconds (..))
import Behavior.Live.Internal.History
import Behavior.Live.Internal.Protocol (Run (..))
import Behavior.Live.Internal.Serving
import Behavior.Live.Internal.Shown
import Behavior.Trace (Event)
import Behavior.Trace.Describe (inert)
import Behavior.Trace.File
import Behavior.Trace.Recording (recording, recordingUntil)

-- | Shows the file, and what is added to it: it looks each time that the first argument returns. When the file is
-- replaced by that of another run, it shows that one. It returns only if it cannot go on, and says why: there is no
-- page, or the file is none of a trace, or a line is damaged. If the file cannot be read, an 'IOException' is thrown.
showFile :: IO () -> LivePage -> FilePath -> IO String
showFile pause page path =
  opened path >>= \case
    Left problem -> pure (explained problem)
    Right begin -> withListener page (pure . ("live page: no page: " ++)) (`follow` begin)
 where
  follow listener begin = showRun pause page path listener begin >>= \case
    Just problem -> pure (explained problem)
    Nothing -> again >>= either (pure . explained) (follow listener)
  -- The program of the next run has removed or emptied the file, and will write to it.
  again = absent (Left EmptyFile) (opened path) >>= \case
    Left problem | problem `elem` [EmptyFile, TornHeader] -> pause >> again
    other -> pure other
  explained problem = inert path ++ ": " ++ explainTraceError problem

-- | The header of a file, and its line, by which another run is noticed.
data Begin = Begin Header Bytes.ByteString

opened :: FilePath -> IO (Either TraceError Begin)
opened path = withBinaryFile path ReadMode $ \file -> do
  (line, rest) <- Char8.break (== '\n') <$> Bytes.hGet file 65536
  pure $ case parseTrace (Lazy.fromStrict (line <> Bytes.take 1 rest)) of
    Left problem -> Left problem
    Right _ | Bytes.null rest -> Left TornHeader
    Right (header, _, _) -> Right (Begin header (line <> Bytes.take 1 rest))

-- | Shows one run, until the file is that of another one, or a line is damaged.
showRun :: IO () -> LivePage -> FilePath -> Listener -> Begin -> IO (Maybe TraceError)
showRun pause page path listener begin@(Begin (Header zero) line) = do
  seen <- newTVarIO (Seen 0 False)
  thisRun <- (\name -> Run (pageRobot page) name zero) <$> newRunName
  showing listener (newShown kept thisRun (time seen)) $ \shown ->
    let go isKnown at = look path begin at >>= \case
          NoMore -> pause >> go True at
          More events after -> do
            let ends = recordingUntil (recording events)
            atomically (modifyTVar' seen (\(Seen latest grows) -> Seen (max latest ends) (grows || isKnown)))
            receive shown events
            go isKnown after
          Another -> pure Nothing
          Damaged problem -> pure (Just problem)
    in go False (ReadSoFar (toInteger (Bytes.length line)) 0 line)
 where
  -- A page keeps as many.
  kept = defaultLimits {mostEnded = 20000, mostReactions = 2000}
  time seen known = do
    Seen latest grows <- readTVarIO seen
    if grows && not (null (runningNow (snapshot known)))
      then max latest . realToFrac . (`diffUTCTime` zero) <$> getCurrentTime
      else pure latest

-- | The time of the last event; and whether the file has grown since it was shown.
data Seen = Seen !Seconds !Bool

-- | How many bytes were read, and events; and the last of the bytes.
data ReadSoFar = ReadSoFar !Integer !Int !Bytes.ByteString

data Look
  = -- | There is no further line.
    NoMore
  | More [Event] ReadSoFar
  | -- | The file is that of another run.
    Another
  | Damaged TraceError

-- | Reads the next lines, as far as they are complete. (A file that is not there is being replaced.)
look :: FilePath -> Begin -> ReadSoFar -> IO Look
look path (Begin _ header) (ReadSoFar from count lastRead) = absent NoMore . withBinaryFile path ReadMode $ \file -> do
  begins <- Bytes.hGet file (Bytes.length header)
  size <- hFileSize file
  hSeek file AbsoluteSeek (from - toInteger (Bytes.length lastRead))
  again <- Bytes.hGet file (Bytes.length lastRead)
  -- (Another run may have the same zero: each simulated one has.)
  if begins /= header || size < from || again /= lastRead then pure Another else found <$> linesFrom file 1048576
 where
  found complete
    | Bytes.null complete = NoMore
    | otherwise = case parseTrace (Lazy.fromChunks [header, complete]) of
        Left (DamagedLine n why) -> Damaged (DamagedLine (n + count) why)
        Left problem -> Damaged problem
        Right (_, events, _) ->
          More events (ReadSoFar (from + toInteger (Bytes.length complete)) (count + length events) (lastOf complete))
  lastOf bytes = Bytes.copy (Bytes.drop (Bytes.length bytes - 4096) bytes)
  linesFrom file most = do
    hSeek file AbsoluteSeek from
    bytes <- Bytes.hGet file most
    let complete = fst (Char8.breakEnd (== '\n') bytes)
    if Bytes.null complete && Bytes.length bytes == most then linesFrom file (2 * most) else pure complete

absent :: a -> IO a -> IO a
absent instead = handleJust (guard . isDoesNotExistError) (const (pure instead))
