{-# LANGUAGE LambdaCase #-}

-- |
-- The reaction of a program that runs with @-threaded@, @+RTS -N2@ and no other options: where its
-- threads run is decided by the runtime, and by 'pinned'. Prints a line for each figure, in
-- microseconds, with changes every 0.3 ms (hot) or 5 ms (colder).
module Main (main) where

import Control.Concurrent (forkIO, getNumCapabilities, newEmptyMVar, putMVar, takeMVar)
import Control.Monad (void)
import Data.List (find)
import GHC.RTS.Flags (getParFlags, migrate)
import System.Environment (getArgs)
import System.Exit (die)

import Behavior
import Behavior.Parallel (pinned, unpinned)
import Computation
import Reaction

-- | Starts a robot's program with the given reaction, and the driver of its device.
type Situation = Behavior () -> IO () -> IO ()

situations :: [(String, Situation)]
situations =
  [ ("alone thread", \react driver -> thread driver >> agent react)
  , ("alone branch", \react driver -> agent (both react driver))
  , ("busy thread", \react driver -> thread driver >> agent (both searching react))
  , ("busy branch", \react driver -> agent (both (both searching react) driver))
  , ("pinned alone thread", \react driver -> thread driver >> agent (pinned react))
  , ("pinned alone branch", \react driver -> agent (pinned (both react driver)))
  , ("pinned busy thread", \react driver -> thread driver >> agent (pinned (both (unpinned searching) react)))
  , ("pinned busy branch", \react driver -> agent (pinned (both (both (unpinned searching) react) driver)))
  ]

agent :: Behavior () -> IO ()
agent = thread . void . runBehavior

thread :: IO () -> IO ()
thread = void . forkIO

main :: IO ()
main =
  getArgs >>= \case
    [name, word]
      | Just start <- lookup name situations
      , Just gap <- find ((== word) . gapName) gaps ->
          measured name start gap
    _ -> die ("usage: plain SITUATION (hot | cold | colder), with one of\n" ++ unlines (map fst situations))

measured :: String -> Situation -> Gap -> IO ()
measured name start gap = do
  probe <- newProbe
  times <- newEmptyMVar
  start (reactor probe) (reactionTimes probe gap seconds >>= putMVar times)
  runtime <- setting
  takeMVar times >>= report ["plain", runtime, gapName gap] name [("p50", 0.5), ("p99", 0.99)]
 where
  seconds = if gapName gap == "hot" then 0.5 else 2

-- | The runtime's options.
setting :: IO String
setting = do
  capabilities <- getNumCapabilities
  flags <- getParFlags
  pure ("N" ++ show capabilities ++ (if migrate flags then "" else " -qm"))
