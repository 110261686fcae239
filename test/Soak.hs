-- |
-- Tests the promises and the specification for the given number of seconds, each round
-- with new programs and new schedules, and prints what was covered.
--
-- > soak 600
--
-- The first round is what a release requires, however long it takes: a hundred thousand
-- random schedules of each promise and of missions of robots, and as many random programs compared with the
-- specification, and with their traces. Without a number of seconds only the first round is run.
module Main (main) where

import Control.Monad (forM, unless, when)
import GHC.Clock (getMonotonicTime)
import Numeric (showFFloat)
import System.Environment (getArgs)
import System.Exit (die, exitFailure)
import System.IO (BufferMode (..), hSetBuffering, stdout)
import Test.QuickCheck (Args (..), Property, isSuccess, numTests, quickCheckWithResult, stdArgs)

import Promises.Properties
import Promises.Stage
import Promises.Trying
import Ros.Promised (keptByMissions)
import SemanticsSpec (allThatIsAllowed, onlyWhatIsAllowed)
import Trace.ProgramsSpec (sinksChangeNothing, tracedRight)

main :: IO ()
main = do
  hSetBuffering stdout LineBuffering
  arguments <- getArgs
  begun <- getMonotonicTime
  seconds <- case map reads arguments of
    [] -> pure 0
    [[(n, "")]] | n >= 0 -> pure (n :: Double)
    _ -> die "soak: the argument is the number of seconds to run, for example 600"
  let rounds n total = do
        tried <- oneRound n
        spent <- subtract begun <$> getMonotonicTime
        let covered = total <> tried
        putStrLn ("-- after " ++ show n ++ " rounds and " ++ secs spent ++ ": " ++ show covered)
        when (spent < seconds) (rounds (n + 1) covered)
  rounds (1 :: Int) mempty

-- | The n-th round, whose programs and schedules are new.
oneRound :: Int -> IO Tried
oneRound n = do
  putStrLn ("-- round " ++ show n)
  tallies <- forM promises $ \promise -> do
    putStrLn (promised promise)
    (<>)
      <$> timed "random schedules" (underRandom (1 + 5000 * (n - 1)) 100000 promise)
      <*> timed "all schedules with up to two pre-emptions" (underAll (1 + 300 * (n - 1)) 2 100000 300 promise)
      <* timed "in reality, 500 programs" (inReality (1 + 500 * (n - 1)) 500 promise)
  putStrLn (promised keptByMissions)
  missions <- timed "random schedules" (underRandom (1 + 10000 * (n - 1)) 100000 keptByMissions)
  putStrLn "The specification"
  checks "random programs, each run a path of the relation" 100000 onlyWhatIsAllowed
  checks "small programs, both sets of outcomes equal" 500 allThatIsAllowed
  putStrLn "Traces"
  checks "random programs, each with the trace that it must have" 100000 tracedRight
  checks "random programs, with sinks and without" 10000 sinksChangeNothing
  pure (mconcat (missions : tallies))

checks :: String -> Int -> Property -> IO ()
checks name n prop = do
  begun <- getMonotonicTime
  result <- quickCheckWithResult stdArgs {maxSuccess = n, maxSize = 100} prop
  ended <- getMonotonicTime
  putStrLn ("  " ++ name ++ ": " ++ show (numTests result) ++ " programs, " ++ secs (ended - begun))
  unless (isSuccess result) exitFailure

timed :: Show a => String -> IO a -> IO a
timed name act = do
  begun <- getMonotonicTime
  a <- act
  ended <- getMonotonicTime
  putStrLn ("  " ++ name ++ ": " ++ show a ++ ", " ++ secs (ended - begun))
  pure a

secs :: Double -> String
secs t = showFFloat (Just 1) t " s"
