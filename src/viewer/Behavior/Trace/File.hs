{-# LANGUAGE BangPatterns #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- Files with traces: a line for each event ("Behavior.Trace.Format").
--
-- A file can be read at any time while it is written, and after its program was killed.
module Behavior.Trace.File
  ( Header (..)

    -- * Writing
  , withTraceFile
  , renderTrace
  , relativeTo

    -- * Reading
  , parseTrace
  , TornLine (..)
  , TraceError (..)
  , explainTraceError
  ) where

import Control.Concurrent.MVar (newMVar, withMVar)
import Control.Exception (IOException, evaluate, mask, onException, throwIO, try)
import Control.Monad (void, when)
import Data.Aeson (FromJSON, Object, Value (..), eitherDecode, (.:))
import Data.Aeson.Types (Key, parseEither)
import Data.ByteString.Builder (toLazyByteString)
import qualified Data.ByteString.Lazy.Char8 as Bytes
import Data.ByteString.Unsafe (unsafeUseAsCStringLen)
import Data.IORef (newIORef, readIORef, writeIORef)
import qualified Data.Text.Encoding.Error as Text
import qualified Data.Text.Lazy as Lazy
import qualified Data.Text.Lazy.Encoding as Lazy
import Data.Time.Clock (getCurrentTime)
import Data.Time.Format.ISO8601 (iso8601ParseM)
import Foreign.Ptr (castPtr)
import GHC.IO.Device (close, write)
import GHC.IO.FD (openFile)
import System.IO (IOMode (..))
import System.IO.Error (ioeSetFileName, modifyIOError)

import Behavior.Time (Seconds, now)
import Behavior.Trace
import Behavior.Trace.Decode (decodeSharing)
import Behavior.Trace.Describe (inertUpTo)
import Behavior.Trace.Format
import Behavior.Trace.Sharing (Texts, noTexts)

-- $setup
-- >>> import Behavior.Trace

-- * Writing

-- | Creates the file, or replaces it, and runs the action with a function that adds events to it.
-- The zero of the file's times is the time at which it was created; the events have the times of
-- 'now'.
--
-- The given events are in the file when the function returns: a program that is killed loses none
-- of them. (A computer that loses its power may lose those of the last seconds.) Several threads
-- may call the function.
--
-- If the file cannot be created, this fails before the action starts. If it cannot be written
-- later, because the disk is full or the action has ended, the function throws an
-- 'Control.Exception.IOException', and so does each later call: so only the last line can be
-- incomplete. What the action returns does not depend on that. If all was written, but the file cannot
-- be closed, that is thrown when the action has returned: a network drive may only then say that it is full.
--
-- @since 0.1.0.0
withTraceFile :: FilePath -> (([Event] -> IO ()) -> IO a) -> IO a
withTraceFile path action = closing $ \file broken -> do
  zero <- now
  header <- Header <$> getCurrentTime
  lock <- newMVar ()
  let add encoded = do
        -- Computing a text may throw. So all of them are computed before any is written.
        bytes <- evaluate (Bytes.toStrict (toLazyByteString encoded))
        withMVar lock $ \() -> do
          readIORef broken >>= \is -> when is (throwIO (userError (path ++ ": an earlier event could not be written")))
          naming (unsafeUseAsCStringLen bytes (\(start, size) -> write file (castPtr start) 0 size))
            `onException` writeIORef broken True
  add (encodeHeader header)
  action (add . foldMap (encodeEvent . relativeTo zero))
 where
  -- (No handle: after a failed write, to close one writes its buffer again.)
  create = fst <$> naming (openFile path WriteMode False)
  naming = modifyIOError (`ioeSetFileName` path)
  -- What the action throws, or what a write threw, is not followed by what closing the file throws.
  closing use = mask $ \restore -> do
    file <- create
    broken <- newIORef False
    result <- restore (use file broken) `onException` closeQuietly file
    isBroken <- readIORef broken
    result <$ (if isBroken then closeQuietly else naming . close) file
  closeQuietly file = void (try (close file) :: IO (Either IOException ()))

-- | The content of a file with these events. Their times are relative to the zero of the header.
--
-- @since 0.1.0.0
renderTrace :: Header -> [Event] -> Bytes.ByteString
renderTrace header events = toLazyByteString (encodeHeader header <> foldMap encodeEvent events)

-- | The event as it is for a clock whose zero is at the given time, in whole nanoseconds. Durations
-- stay as they are.
--
-- >>> let ended = Ended (Span 1 Top Named "survey" 103.1 Nothing) 104 (StoppedBy (TimeLimit 0.9))
-- >>> [(spanBegan s, t, end) | Ended s t end <- [relativeTo 100 ended]]
-- [(3.1,4.0,StoppedBy (TimeLimit 0.9))]
--
-- @since 0.1.0.0
relativeTo :: Seconds -> Event -> Event
relativeTo zero = \case
  Began s -> Began (began s)
  Ended s t end -> Ended (began s) (relative t) end
  Reacted r -> Reacted r {reactionTime = relative (reactionTime r)}
  Lost n -> Lost n
 where
  began s = s {spanBegan = relative (spanBegan s)}
  relative = nanoseconds . subtract zero
  -- A difference of two times has digits that mean nothing.
  nanoseconds t
    | abs t < 1e6 = fromInteger (round (t * 1e9)) / 1e9
    | otherwise = t

-- * Reading

-- | An incomplete last line: what was being written when the program was killed.
--
-- @since 0.1.0.0
data TornLine = TornLine
  { tornLine :: !Int
  -- ^ Its number. The first line has number 1.
  , tornBytes :: !Int
  -- ^ How many bytes of it there are.
  }
  deriving (Eq, Ord, Show)

-- | Why a file cannot be read.
--
-- @since 0.1.0.0
data TraceError
  = -- | It has no bytes.
    EmptyFile
  | -- | It ends within its first line.
    TornHeader
  | -- | Its first line is no header of this format: how it begins.
    ForeignFile String
  | -- | The version of its format, which this module cannot read.
    OtherVersion Integer
  | -- | The number of a line that is no event (or of the header, 1), and why not.
    DamagedLine Int String
  deriving (Eq, Ord, Show)

-- | Describes the error on one line: in which line of the file, what is wrong, and what is allowed.
--
-- >>> putStrLn (explainTraceError (OtherVersion 7))
-- line 1: version 7 of the format; allowed: version 1. A newer release of behavior-trace may read it
--
-- @since 0.1.0.0
explainTraceError :: TraceError -> String
explainTraceError = \case
  EmptyFile -> "line 1: the file is empty; " ++ allowed
  TornHeader -> "line 1: the file ends within its header; " ++ allowed
  ForeignFile begins -> "line 1: this is no trace: " ++ show (inertUpTo 60 begins) ++ "; " ++ allowed
  OtherVersion n ->
    "line 1: version " ++ inertUpTo 60 (show n) ++ " of the format; allowed: version " ++ show formatVersion
      ++ ". A newer release of behavior-trace may read it"
  DamagedLine n why -> "line " ++ show n ++ ": " ++ inertUpTo 400 why
 where
  allowed = "allowed: a header {\"format\":\"behavior-trace\",\"version\":1,...}, then a line for each event"

-- | Reads the content of a file. If its program was killed, the last line can be incomplete: then
-- the result contains all events before it, and how much there is of that line.
--
-- @since 0.1.0.0
parseTrace :: Bytes.ByteString -> Either TraceError (Header, [Event], Maybe TornLine)
parseTrace bytes = case Bytes.split '\n' bytes of
  [] -> Left EmptyFile
  first : rest -> do
    header <- decodeHeader (null rest) first
    (events, torn) <- go 2 noTexts 0 [] rest
    pure (header, events, torn)
 where
  -- The last element is what follows the last newline: only that can be incomplete.
  go :: Int -> Texts -> Int -> [Event] -> [Bytes.ByteString] -> Either TraceError ([Event], Maybe TornLine)
  go !n !texts !lostBefore before = \case
    [] -> Right (reverse before, Nothing)
    [end] | Bytes.null end -> Right (reverse before, Nothing)
    content : after -> case decodeSharing texts content of
      Right (Lost more, _)
        | more > maxBound - lostBefore -> Left (DamagedLine n "more events were lost than can be counted")
      Right (this, textsAfter) -> go (n + 1) textsAfter (lostBefore + lostIn this) (this : before) after
      Left (NotJson _) | null after -> Right (reverse before, Just (TornLine n (fromIntegral (Bytes.length content))))
      Left (NotJson why) -> Left (DamagedLine n ("this is not a line of JSON: " ++ why))
      Left (NotAnEvent why) -> Left (DamagedLine n ("this is no event: " ++ why))
  lostIn (Lost n) = n
  lostIn _ = 0

decodeHeader :: Bool -> Bytes.ByteString -> Either TraceError Header
decodeHeader isLast first = case eitherDecode first of
  Right (Object o) | Right f <- parseEither (.: "format") o, f == formatName -> do
    version <- field o "version"
    when (version /= toInteger formatVersion) $
      if version < 1 then Left (damaged "version: allowed: 1") else Left (OtherVersion version)
    zero <- field o "zero"
    maybe
      (Left (damaged "zero: allowed: a time such as \"2026-01-31T12:00:00Z\""))
      (Right . Header)
      (iso8601ParseM zero)
  -- (Of a device that never ends, the end of its first line is not looked for.)
  Left _ | begin `Bytes.isPrefixOf` first || first `Bytes.isPrefixOf` begin, isLast -> Left TornHeader
  Left why | begin `Bytes.isPrefixOf` first -> Left (damaged why)
  _ -> Left (ForeignFile (decodedText (Bytes.take 200 first)))
 where
  begin = "{\"format\":\"behavior-trace\""
  field :: FromJSON a => Object -> Key -> Either TraceError a
  field o key = either (Left . damaged) Right (parseEither (.: key) o)
  damaged = DamagedLine 1 . ("this header is damaged: " ++)

decodedText :: Bytes.ByteString -> String
decodedText = Lazy.unpack . Lazy.decodeUtf8With Text.lenientDecode
