{-# LANGUAGE OverloadedStrings #-}

-- |
-- The rows of robots that no one here has written: real action servers over a real bridge. @.ci/robots@ starts them;
-- @test/robots/judge.py@ says how each row went.
--
-- > robots 2 3 4
module Main (main) where

import Control.Exception (displayException)
import Control.Monad (unless, when)
import Data.Aeson ((.=))
import Data.Foldable (for_)
import System.Environment (getArgs)
import System.Exit (die)

import Behavior
import Behavior.Time (timeout)
import Robots.Cancelling
import Robots.Stage

rows :: [(Row, Stage -> Behavior ())]
rows =
  [ (2, atRandomInstants)
  , (3, atOnce)
  , (4, neverConfirmed)
  ]

main :: IO ()
main = do
  arguments <- map read <$> getArgs
  unless (all (`elem` map fst rows) arguments) $ die ("robots: the rows are " ++ unwords (map (show . fst) rows))
  stage <- newStage
  runBehavior . for_ rows $ \(n, row) -> when (n `elem` arguments) (runRow stage n (row stage))

-- | Writes how the row ended. (A fault of one does not end the others.)
runRow :: Stage -> Row -> Behavior () -> Behavior ()
runRow stage n row = do
  begun <- clock
  how <- tryAny (timeout 600 row)
  ended <- clock
  note stage n ["row ended" .= either displayException (const "well") how, "seconds" .= (ended - begun)]
