-- |
-- What is around a program that only computes a text and prints it. (A program with this module also has streams.c.)
module Command
  ( command
  ) where

import Control.Exception (displayException, try)
import GHC.IO.Exception (IOErrorType (..), IOException (..))
import System.Exit (ExitCode (..), exitWith)
import System.IO

import Behavior.Trace.Describe (inert)

-- | A whole program: runs the action, prints what it returns, and exits. The action returns the exit status, and what
-- is printed on the standard output and on the standard error output.
--
-- The exit status is 2 if the standard output cannot be written, and the reason is printed on the standard error
-- output. A pipe that its reader has closed is no error.
command :: IO (ExitCode, String, String) -> IO ()
command action = do
  -- A character that the terminal cannot show must not be an error.
  encoding <- mkTextEncoding (show localeEncoding ++ "//TRANSLIT")
  mapM_ (`hSetEncoding` encoding) [stdout, stderr]
  (status, printed, remarks) <- action
  -- (If this fails, there is nothing to report it on.)
  _ <- attempt (hPutStr stderr remarks)
  written <- attempt (putStr printed >> hFlush stdout)
  case written of
    -- The reader of a pipe has closed it: it has what it wants.
    Left e | ioe_type e /= ResourceVanished -> do
      _ <- attempt (hPutStrLn stderr (inert (displayException e)))
      exitWith (ExitFailure 2)
    _ -> exitWith status
 where
  attempt act = try act :: IO (Either IOException ())
