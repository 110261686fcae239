-- |
-- Shows the file of a trace.
module Main (main) where

import Control.Exception (displayException, try)
import GHC.IO.Exception (IOErrorType (..), IOException (..))
import System.Environment (getArgs)
import System.Exit (ExitCode (..), exitWith)
import System.IO

import Behavior.Trace.Describe (inert)
import Tool

main :: IO ()
main = do
  -- A character that the terminal cannot show must not be an error.
  encoding <- mkTextEncoding (show localeEncoding ++ "//TRANSLIT")
  mapM_ (`hSetEncoding` encoding) [stdout, stderr]
  (status, printed, remarks) <- getArgs >>= run
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
