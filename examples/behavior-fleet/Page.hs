{-# LANGUAGE OverloadedStrings #-}

-- |
-- One live page for all robots of a fleet that have one.
module Page
  ( fleetPage
  ) where

import Data.Text (Text)
import qualified Data.Text as Text
import Database.PostgreSQL.Simple (query_)

import Behavior (Behavior, tryAny)
import Behavior.Fleet.Internal.Migration (withDatabase)
import Behavior.Live.Hub
import Behavior.Parallel (firstOf)
import Behavior.STM
import Behavior.Time (every)

-- | Serves the page at that port, for the fleet in the database at this address, until it is stopped. It returns only
-- if there can be no page: why. (While the database is away, the page shows those that it has shown.)
fleetPage :: Int -> String -> Behavior String
fleetPage port at = do
  robots <- pages at >>= newTVarIO
  firstOf
    [ hub loopback {pageRobot = "fleet", pagePort = port} (readTVar robots)
    , every 2 (tryAny (pages at) >>= either (\_ -> pure ()) (atomically . writeTVar robots))
    ]

-- | The robots of each process that has said that it has a page, and its address. (That of a process that was killed is
-- grey, until another process has it.)
pages :: String -> Behavior [(String, String)]
pages at = withDatabase at $ \connection ->
  map (\(name, page) -> (Text.unpack name, Text.unpack (page :: Text)))
    <$> query_
      connection
      "select array_to_string(robots, ', '), page from (select distinct on (page) robots, page from fleet.processes \
      \where page is not null order by page, seen desc) these order by 1"
