{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- The program @behavior-trace@.
module Tool
  ( run
  ) where

import Control.Exception (IOException, displayException, evaluate, try)
import Control.Monad (when)
import Control.Monad.Trans.Except (ExceptT (..), runExceptT, throwE)
import qualified Data.ByteString.Lazy as Lazy
import qualified Data.Text as Text
import Data.Text.Lazy.Encoding (encodeUtf8)
import Options.Applicative
import System.Directory (canonicalizePath)
import System.Exit (ExitCode (..))
import System.FilePath (takeBaseName, takeFileName)

import Behavior (runBehavior, sleep)
import Behavior.Live (LivePage (..), loopback)
import Behavior.Live.Hub (hub)
import Behavior.Live.Internal.Following (showFile)
import Behavior.Trace (Event)
import Behavior.Trace.Describe (inert)
import Behavior.Trace.Diff
import Behavior.Trace.File
import Behavior.Trace.Otlp
import Behavior.Trace.Recording
import Behavior.Trace.Summary
import Behavior.Trace.Svg
import Behavior.Trace.TraceEvents
import Behavior.Trace.Tree

data Options
  = OfFile FilePath Mode
  | -- | Shows these robots, each by its name and the address of its live page, on one page.
    Hub [(String, String)]

data Mode
  = -- | Prints a text.
    Print (Recording -> String)
  | -- | Writes a file, given the robot's name too, and the header.
    Write (String -> Header -> Recording -> Lazy.ByteString) FilePath
  | -- | Compares with another file.
    Compare FilePath
  | -- | Shows it on a page.
    Live

-- | Runs the program with these arguments. The result is its exit status, and what it prints on the
-- standard output and on the standard error output.
run :: [String] -> IO (ExitCode, String, String)
run arguments = case execParserPure defaultPrefs commandLine arguments of
  Success options -> do
    result <- runExceptT (performAll options)
    pure $ case result of
      Left problem -> (ExitFailure 2, "", problem ++ "\n")
      Right (printed, remarks) -> (ExitSuccess, printed, unlines remarks)
  Failure failure -> case renderFailure failure "behavior-trace" of
    (text, ExitSuccess) -> pure (ExitSuccess, text ++ "\n", "")
    (text, status) -> pure (status, "", text ++ "\n")
  CompletionInvoked completion -> do
    text <- execCompletion completion "behavior-trace"
    pure (ExitSuccess, text, "")

commandLine :: ParserInfo Options
commandLine =
  info (helper <*> (ofFile <|> Hub <$> some ofRobot)) $
    fullDesc
      <> failureCode 2
      <> progDesc "Shows what a robot did, since when, and what interrupted it."
      <> footer
        "Exit status: 0, or 2 if the options are wrong or a file or the output cannot be read or written. A last line \
        \that is incomplete, because the program was killed, is no error, nor is a pipe that its reader closed."
 where
  ofFile = OfFile <$> strArgument (metavar "FILE" <> help "the file of a trace") <*> modes
  ofRobot =
    option (eitherReader nameAndAddress) $
      long "hub" <> metavar "NAME=ADDRESS"
        <> help "serve a page of all these robots until Ctrl-C: an address is that of the robot's live page"
  -- (A name may have any characters; so may a token, but those of an address are escaped.)
  nameAndAddress text = case Text.breakOnEnd (Text.pack "=http://") (Text.pack text) of
    (name, rest) | not (Text.null name) -> Right (Text.unpack (Text.dropEnd 8 name), "http://" ++ Text.unpack rest)
    _ -> Left "allowed: NAME=http://HOST:PORT/ or NAME=http://HOST:PORT/#TOKEN"

modes :: Parser Mode
modes =
  flag' (Print renderTree) (long "tree" <> help "print what ran, one inside the other, and how it ended")
    <|> flag'
      (Print (renderSummary . summary))
      (long "summary" <> help "print where the time went, what interrupted, and what failed")
    <|> writing "svg" (ofRecording (encodeUtf8 . timeline)) "draw the timeline: one SVG file, which a browser shows"
    <|> writing
      "trace-events"
      (ofRecording renderTraceEvents)
      "write the trace-event format, for Perfetto, Chrome and speedscope"
    <|> writing "otlp" renderOtlp "write a trace of OpenTelemetry (OTLP in JSON), for its collector, Jaeger and Tempo"
    <|> Compare <$> strOption (long "diff" <> metavar "OTHER" <> help "print what another trace has differently")
    <|> flag'
      Live
      (long "live" <> help "serve a page that shows it in a browser, also while it is written, until Ctrl-C")
 where
  ofRecording render _ _ = render
  writing name render what = Write render <$> strOption (long name <> metavar "OUT" <> help what)

performAll :: Options -> ExceptT String IO (String, [String])
performAll options = case options of
  OfFile file mode -> perform file mode
  -- (Robots on this machine have their own pages at the ports from 8420 on.)
  Hub robots -> attempt (runBehavior (hub loopback {pageRobot = "robots", pagePort = 8410} (pure robots))) >>= throwE

perform :: FilePath -> Mode -> ExceptT String IO (String, [String])
perform file mode = case mode of
  Print render -> do
    (_, events, remarks) <- load file
    pure (render (recording events), remarks)
  Write render out -> do
    (zero, events, remarks) <- load file
    same <- attempt ((==) <$> canonicalizePath file <*> canonicalizePath out)
    when same (throwE (inert out ++ ": this is the file of the trace; allowed: another file"))
    attempt (Lazy.writeFile out (render (takeBaseName file) zero (recording events)))
    pure ("", remarks)
  Compare other -> do
    (_, events, remarks) <- load file
    (_, otherEvents, otherRemarks) <- load other
    pure (renderDifference (difference (recording events) (recording otherEvents)), remarks ++ otherRemarks)
  Live ->
    attempt (runBehavior (showFile (sleep 0.1) loopback {pageRobot = takeFileName file} file)) >>= throwE

-- The header and the events of a file, and a remark if its last line is incomplete.
load :: FilePath -> ExceptT String IO (Header, [Event], [String])
load file = do
  -- It is read while it is parsed, so that it is never in memory as a whole.
  parsed <- attempt (Lazy.readFile file >>= evaluate . parseTrace)
  case parsed of
    Left problem -> throwE (inert file ++ ": " ++ explainTraceError problem)
    Right (zero, events, torn) -> pure (zero, events, maybe [] (pure . remark) torn)
 where
  remark (TornLine n bytes) =
    inert file ++ ": line " ++ show n ++ ": incomplete (" ++ show bytes
      ++ " bytes), and left out: the program was killed, or is still writing"

attempt :: IO a -> ExceptT String IO a
attempt io = ExceptT $ try io >>= \case
  Left (e :: IOException) -> pure (Left (inert (displayException e)))
  Right a -> pure (Right a)
