{-# LANGUAGE OverloadedStrings #-}

-- |
-- The rows of robots that no one here has written: real action servers over a real bridge. @.ci/robots@ starts them;
-- @test/robots/judge.py@ says how each row went.
--
-- > robots 2 3 4
--
-- Two of these programs can run at once, if no row is of both.
module Main (main) where

import Control.Exception (displayException)
import Control.Monad (forever, unless, when)
import Data.Aeson ((.=))
import Data.Foldable (for_)
import Data.IORef
import System.Environment (getArgs)
import System.Exit (die)

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.Time (timeout)
import Robots.Agreeing
import Robots.Campaign
import Robots.Cancelling
import Robots.Clients
import Robots.Cost
import Robots.Lies
import Robots.Losing
import Robots.Missions
import Robots.Navigating
import Robots.Topics

rows :: [(Row, Campaign -> Behavior ())]
rows =
  [ (1, missions)
  , (2, atRandomInstants)
  , (3, atOnce)
  , (4, neverConfirmed)
  , (5, killed)
  , (6, halfOpen)
  , (7, restarted)
  , (8, silences)
  , (9, floods)
  , (10, hostile)
  , (12, twoClients)
  , (13, twoRobots)
  , (15, costs)
  , (16, agreeing)
  , (17, navigating)
  ]

main :: IO ()
main = do
  arguments <- map read <$> getArgs
  unless (not (null arguments) && all (`elem` map fst rows) arguments) $
    die ("robots: the rows are " ++ unwords (map (show . fst) rows))
  campaign <- newCampaign (minimum arguments)
  runBehavior . for_ rows $ \(n, row) -> when (n `elem` arguments) (runRow campaign n (row campaign))

-- | Writes how the row ended, and by how much a thread that slept beside it was late at most: so late may all that is
-- measured there be. (A fault of one row does not end the others.)
runRow :: Campaign -> Row -> Behavior () -> Behavior ()
runRow campaign n row = do
  latest <- newIORef 0
  begun <- clock
  how <- tryAny (firstOf [timeout (if isLong campaign then 1800 else 150) row, lateness latest])
  ended <- clock
  late <- readIORef latest
  note campaign n
    ["row ended" .= either displayException (const "well") how, "seconds" .= (ended - begun), "late" .= late]
 where
  lateness latest = forever $ do
    before <- clock
    sleep 0.02
    after <- clock
    modifyIORef' latest (max (after - before - 0.02))
