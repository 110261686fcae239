-- |
-- Shows the file of a trace.
module Main (main) where

import System.Environment (getArgs)

import Command
import Tool

main :: IO ()
main = command (getArgs >>= run)
