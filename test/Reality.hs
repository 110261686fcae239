-- |
-- A long comparison of the simulator with reality. The first argument is the seed of the
-- random programs, the others are those of hspec.
--
-- > reality 7
module Main (main) where

import System.Environment (getArgs, withArgs)
import System.Exit (die)
import Test.Hspec

import Reality.RealitySpec

main :: IO ()
main = do
  arguments <- getArgs
  case arguments of
    n : others | [(number, "")] <- reads n ->
      withArgs others . hspec $ specWith (Effort 1000 2000 number 200 20000 10000 60)
    _ -> die "reality: the first argument is the seed of the random programs, for example 7"
