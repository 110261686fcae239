-- |
-- For the one that keeps a fleet's database.
module Main (main) where

import System.Environment (getArgs)

import Command
import Tool

main :: IO ()
main = command (getArgs >>= run)
