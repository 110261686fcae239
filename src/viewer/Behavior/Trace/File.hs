{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- Files with traces: a line of JSON for each event. @docs\/trace-format.md@ describes each field.
--
-- A file can be read at any time while it is written, and after its program was killed.
module Behavior.Trace.File
  ( -- * Writing
    withTraceFile
  , renderTrace
  , encodeHeader
  , encodeEvent
  , relativeTo

    -- * Reading
  , parseTrace
  , decodeEvent
  , NoEvent (..)
  , TornLine (..)
  , TraceError (..)
  , explainTraceError

    -- * The header
  , Header (..)
  , version
  ) where

import Control.Concurrent.MVar (newMVar, withMVar)
import Control.Exception (IOException, evaluate, mask, onException, throwIO, try)
import Control.Monad (void, when, (>=>))
import Data.Aeson (FromJSON, Object, Value (..), eitherDecode, parseJSON, withObject, withText, (.:), (.:?))
import Data.Aeson.Encoding (Encoding, Series, int, list, pair, pairs)
import Data.Aeson.Types (Key, Parser, parseEither)
import Data.ByteString.Builder (Builder, char7, toLazyByteString)
import Data.ByteString.Unsafe (unsafeUseAsCStringLen)
import qualified Data.ByteString.Lazy.Char8 as Bytes
import Data.IORef (newIORef, readIORef, writeIORef)
import Data.List (intercalate)
import Data.Maybe (fromMaybe)
import qualified Data.Text as Text
import qualified Data.Text.Lazy as Lazy
import qualified Data.Text.Lazy.Encoding as Lazy
import qualified Data.Text.Encoding.Error as Text
import Data.Time.Clock (UTCTime, getCurrentTime)
import Data.Time.Format.ISO8601 (iso8601ParseM, iso8601Show)
import Foreign.Ptr (castPtr)
import GHC.IO.Device (close, write)
import GHC.IO.FD (openFile)
import System.IO (IOMode (..))
import System.IO.Error (ioeSetFileName, modifyIOError)

import Behavior.Internal.Seconds (Seconds (..))
import Behavior.Time (now)
import Behavior.Trace
import Behavior.Trace.Describe (inertUpTo)
import Behavior.Trace.Json

-- $setup
-- >>> import Behavior.Trace

-- | The first line of a file.
--
-- @since 0.1.0.0
newtype Header = Header
  { zeroTime :: UTCTime
  -- ^ The time of day at which the times of the events are 0.
  }
  deriving (Eq, Ord, Show)

-- | The version of the format that this module writes and reads.
--
-- @since 0.1.0.0
version :: Int
version = 1

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
  let add lines' = do
        -- Computing a text may throw. So all of them are computed before any is written.
        bytes <- evaluate (Bytes.toStrict (toLazyByteString lines'))
        withMVar lock $ \() -> do
          readIORef broken >>= \is -> when is (throwIO (userError (path ++ ": an earlier event could not be written")))
          naming (unsafeUseAsCStringLen bytes (\(start, size) -> write file (castPtr start) 0 size)) `onException` writeIORef broken True
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
-- >>> relativeTo 100 (Ended (Span 1 Top Named "survey" 103.1 Nothing) 104 (StoppedBy (TimeLimit 0.9)))
-- Ended (Span {spanNumber = 1, spanParent = Top, spanKind = Named, spanName = "survey", spanBegan = 3.1, spanReaction = Nothing}) 4.0 (StoppedBy (TimeLimit 0.9))
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

-- | The first line.
--
-- @since 0.1.0.0
encodeHeader :: Header -> Builder
encodeHeader (Header zero) =
  line (pair "format" (text format) <> pair "version" (int version) <> pair "zero" (text (iso8601Show zero)))

format :: String
format = "behavior-trace"

-- | The line of an event.
--
-- @since 0.1.0.0
encodeEvent :: Event -> Builder
encodeEvent =
  line . \case
    Began s -> pair "event" (text "began") <> spanFields s
    Ended s t end ->
      pair "event" (text "ended") <> spanFields s <> pair "ended" (seconds t) <> pair "end" (encodeEnd end)
    Reacted r ->
      pair "event" (text "reacted")
        <> pair "number" (int (reactionNumber r))
        <> pair "parent" (encodeParent (reactionParent r))
        <> pair "operator" (text (reactionOperator r))
        <> pair "time" (seconds (reactionTime r))
        <> pair "changes" (list encodeChange (reactionChanges r))
        <> optional "stopped" encodeStopped (reactionStopped r)
        <> optional "starts" text (reactionStarts r)
    Lost n -> pair "event" (text "lost") <> pair "count" (int n)

line :: Series -> Builder
line fields = written (pairs fields) <> char7 '\n'

spanFields :: Span -> Series
spanFields s =
  pair "number" (int (spanNumber s))
    <> pair "parent" (encodeParent (spanParent s))
    <> pair "kind" (text (nameIn kinds (spanKind s)))
    <> pair "name" (text (spanName s))
    <> pair "began" (seconds (spanBegan s))
    <> optional "reaction" int (spanReaction s)

encodeParent :: Parent -> Encoding
encodeParent = \case
  Inside n -> int n
  Top -> text "top"
  UnknownParent -> text "unknown"

encodeEnd :: End -> Encoding
encodeEnd =
  pairs . \case
    Succeeded -> pair "how" (text "succeeded")
    FailedWith why -> pair "how" (text "failed") <> pair "text" (text why)
    FaultedWith why -> pair "how" (text "faulted") <> pair "text" (text why)
    StoppedBy cause -> pair "how" (text "stopped") <> pair "cause" (encodeCause cause)

encodeCause :: Cause -> Encoding
encodeCause =
  pairs . \case
    SignalChanged n changes ->
      pair "why" (text "signal") <> pair "reaction" (int n) <> pair "changes" (list encodeChange changes)
    SiblingFinished branch -> pair "why" (text "sibling finished") <> pair "branch" (text branch)
    SiblingFailed branch -> pair "why" (text "sibling failed") <> pair "branch" (text branch)
    TimeLimit t -> pair "why" (text "time limit") <> pair "limit" (seconds t)
    FromOutside exception -> pair "why" (text "from outside") <> pair "exception" (text exception)
    WasAbandoned -> pair "why" (text "abandoned")

encodeChange :: Change -> Encoding
encodeChange c =
  pairs $
    pair "signal" (text (changeSignal c))
      <> optional "before" text (changeBefore c)
      <> pair "after" (text (changeAfter c))

encodeStopped :: StoppedBranch -> Encoding
encodeStopped s =
  pairs $
    pair "name" (text (stoppedName s))
      <> pair "after" (seconds (stoppedAfter s))
      <> pair "took" (seconds (stoppingTook s))
      <> pair "end" (encodeEnd (stoppedEnd s))

seconds :: Seconds -> Encoding
seconds (Seconds t) = number t

optional :: Key -> (a -> Encoding) -> Maybe a -> Series
optional key encode = maybe mempty (pair key . encode)

kinds :: [(String, SpanKind)]
kinds = [("named", Named), ("operator", Operator), ("branch", Branch)]

nameIn :: Eq a => [(String, a)] -> a -> String
nameIn table x = head [name | (name, y) <- table, x == y]

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
    "line 1: version " ++ inertUpTo 60 (show n) ++ " of the format; allowed: version " ++ show version
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
    (events, torn) <- go 2 [] rest
    pure (header, events, torn)
 where
  -- The last element is what follows the last newline.
  go :: Int -> [Event] -> [Bytes.ByteString] -> Either TraceError ([Event], Maybe TornLine)
  go n before = \case
    [] -> Right (reverse before, Nothing)
    [end] | Bytes.null end -> Right (reverse before, Nothing)
    content : after -> case decodeEvent content of
      Right this -> go (n + 1) (this : before) after
      Left (NotJson _) | all Bytes.null after, length (take 2 after) < 2 ->
        Right (reverse before, Just (TornLine n (fromIntegral (Bytes.length content))))
      Left (NotJson why) -> Left (DamagedLine n ("this is not a line of JSON: " ++ why))
      Left (NotAnEvent why) -> Left (DamagedLine n ("this is no event: " ++ why))

decodeHeader :: Bool -> Bytes.ByteString -> Either TraceError Header
decodeHeader isLast first = case eitherDecode first of
  Right (Object o) | Right f <- parseEither (.: "format") o, f == format -> do
    number' <- field o "version"
    when (number' /= toInteger version) $
      if number' < 1 then Left (damaged "version: allowed: 1") else Left (OtherVersion number')
    zero <- field o "zero"
    maybe (Left (damaged "zero: allowed: a time such as \"2026-01-31T12:00:00Z\"")) (Right . Header) (iso8601ParseM zero)
  Left _ | isLast, begin `Bytes.isPrefixOf` first || first `Bytes.isPrefixOf` begin -> Left TornHeader
  Left why | begin `Bytes.isPrefixOf` first -> Left (damaged why)
  _ -> Left (ForeignFile (decodedText (Bytes.take 200 first)))
 where
  begin = "{\"format\":\"behavior-trace\""
  field :: FromJSON a => Object -> Key -> Either TraceError a
  field o key = either (Left . damaged) Right (parseEither (.: key) o)
  damaged = DamagedLine 1 . ("this header is damaged: " ++)

decodedText :: Bytes.ByteString -> String
decodedText = Lazy.unpack . Lazy.decodeUtf8With Text.lenientDecode

-- | Why a line is no event.
--
-- @since 0.1.0.0
data NoEvent
  = -- | It is not JSON, for example because it is incomplete.
    NotJson String
  | -- | It is JSON, but not that of an event.
    NotAnEvent String
  deriving (Eq, Show)

-- | The event of a line.
--
-- @since 0.1.0.0
decodeEvent :: Bytes.ByteString -> Either NoEvent Event
decodeEvent = either (Left . NotJson) Right . eitherDecode >=> either (Left . NotAnEvent) Right . parseEither event

event :: Value -> Parser Event
event = withObject "an event" $ \o ->
  choose o "event"
    [ ("began", Began <$> spanOf o)
    , ("ended", Ended <$> spanOf o <*> (o .: "ended" >>= secondsOf) <*> (o .: "end" >>= endOf))
    , ("reacted", Reacted <$> reactionOf o)
    , ("lost", Lost <$> o .: "count")
    ]

spanOf :: Object -> Parser Span
spanOf o =
  Span
    <$> o .: "number"
    <*> (o .: "parent" >>= parentOf)
    <*> choose o "kind" [(name, pure kind) | (name, kind) <- kinds]
    <*> o .: "name"
    <*> (o .: "began" >>= secondsOf)
    <*> o .:? "reaction"

reactionOf :: Object -> Parser Reaction
reactionOf o =
  Reaction
    <$> o .: "number"
    <*> (o .: "parent" >>= parentOf)
    <*> o .: "operator"
    <*> (o .: "time" >>= secondsOf)
    <*> (o .: "changes" >>= traverse changeOf)
    <*> (o .:? "stopped" >>= traverse stoppedOf)
    <*> o .:? "starts"

parentOf :: Value -> Parser Parent
parentOf = \case
  String "top" -> pure Top
  String "unknown" -> pure UnknownParent
  number'@(Number _) -> Inside <$> parseJSON number'
  _ -> fail "parent: allowed: a number, \"top\", \"unknown\""

endOf :: Value -> Parser End
endOf = withObject "an end" $ \o ->
  choose o "how"
    [ ("succeeded", pure Succeeded)
    , ("failed", FailedWith <$> o .: "text")
    , ("faulted", FaultedWith <$> o .: "text")
    , ("stopped", StoppedBy <$> (o .: "cause" >>= causeOf))
    ]

causeOf :: Value -> Parser Cause
causeOf = withObject "a cause" $ \o ->
  choose o "why"
    [ ("signal", SignalChanged <$> o .: "reaction" <*> (o .: "changes" >>= traverse changeOf))
    , ("sibling finished", SiblingFinished <$> o .: "branch")
    , ("sibling failed", SiblingFailed <$> o .: "branch")
    , ("time limit", TimeLimit <$> (o .: "limit" >>= secondsOf))
    , ("from outside", FromOutside <$> o .: "exception")
    , ("abandoned", pure WasAbandoned)
    ]

changeOf :: Value -> Parser Change
changeOf = withObject "a change" $ \o -> Change <$> o .: "signal" <*> o .:? "before" <*> o .: "after"

stoppedOf :: Value -> Parser StoppedBranch
stoppedOf = withObject "a stopped branch" $ \o ->
  StoppedBranch
    <$> o .: "name"
    <*> (o .: "after" >>= secondsOf)
    <*> (o .: "took" >>= secondsOf)
    <*> (o .: "end" >>= endOf)

secondsOf :: Value -> Parser Seconds
secondsOf = \case
  String "inf" -> pure (1 / 0)
  String "-inf" -> pure (-1 / 0)
  String "nan" -> pure (0 / 0)
  number'@(Number _) -> Seconds <$> parseJSON number'
  _ -> fail "a time: allowed: a number, \"inf\", \"-inf\", \"nan\""

-- The field's text selects how the rest is read.
choose :: Object -> Key -> [(String, Parser a)] -> Parser a
choose o key table =
  o .: key >>= withText (show key) (\name -> fromMaybe (refuse (Text.unpack name)) (lookup (Text.unpack name) table))
 where
  refuse name = fail (show key ++ " is " ++ show (inertUpTo 60 name) ++ "; allowed: " ++ intercalate ", " (map fst table))
