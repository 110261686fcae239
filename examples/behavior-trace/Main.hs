-- |
-- Shows the file of a trace.
module Main (main) where

import System.Environment (getArgs)
import System.Exit (exitWith)
import System.IO

import Tool

main :: IO ()
main = do
  -- A character that the terminal cannot show must not be an error.
  encoding <- mkTextEncoding (show localeEncoding ++ "//TRANSLIT")
  mapM_ (`hSetEncoding` encoding) [stdout, stderr]
  (status, printed, remarks) <- getArgs >>= run
  hPutStr stderr remarks
  putStr printed
  hFlush stdout
  exitWith status
