{-# LANGUAGE GADTs #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The model does what the schema does: random requests of both, at the same times.
module Fleets.Agreeing
  ( agreeing
  ) where

import Control.Monad (void)
import Data.ByteString (ByteString)
import Data.IORef
import Database.PostgreSQL.Simple (Connection, Only (..), connectPostgreSQL, execute, execute_, query_)
import Test.QuickCheck
import Test.QuickCheck.Monadic
import Test.QuickCheck.Random (mkQCGen)

import Behavior (Seconds)
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Database
import Behavior.Fleet.Internal.Model
import Behavior.Fleet.Internal.Model.Tables (emptyModel)
import Behavior.Fleet.Internal.Postgres
import Fleet.Requests

-- | The addresses of the owner of an empty fleet, whose clock is replaced, and of a robot; the seed; and how many
-- sequences of requests are tried. Whether the two agree.
agreeing :: ByteString -> String -> Int -> Int -> IO Bool
agreeing owner robot seed count = do
  admin <- connectPostgreSQL owner
  replaceClock admin
  opening (postgres robot) 5 $ \session -> do
    listen session
    result <- quickCheckWithResult stdArgs {maxSuccess = count, replay = Just (mkQCGen seed, 0)} $
      forAllShrinkShow steps (shrinkList (const [])) (const "") $ \these -> monadicIO $ do
        said <- run (newIORef [])
        ok <- run (tried admin session said these)
        text <- run (readIORef said)
        monitor (counterexample (unlines (reverse text)))
        assert ok
    pure (isSuccess result)

-- | The clock is a table.
replaceClock :: Connection -> IO ()
replaceClock admin =
  void . execute_ admin $
    "set client_min_messages = warning; \
    \create table if not exists fleet.tested (at timestamptz); \
    \delete from fleet.tested; \
    \insert into fleet.tested values ('2026-01-01'); \
    \grant select on fleet.tested to fleet_robot; \
    \create or replace function fleet.clock() returns timestamptz language sql volatile as \
    \'select at from fleet.tested'"

setTime :: Connection -> Seconds -> IO ()
setTime admin time =
  void $
    execute
      admin
      "update fleet.tested set at = timestamptz '2026-01-01 00:00 UTC' + ? * interval '1 s'"
      (Only (realToFrac time :: Double))

-- | An empty fleet at the time 0, as the model begins.
begin :: Connection -> IO ()
begin admin = do
  void $ execute_ admin
    "truncate fleet.task, fleet.resource, fleet.place, fleet.process restart identity; \
    \select setval('fleet.number', 999999); \
    \update fleet.about set epoch = 1, seen = 0, is_restored = false, holds_from = '-infinity'"
  setTime admin 0

tried :: Connection -> Session -> IORef [String] -> [Step] -> IO Bool
tried admin session said these = do
  begin admin
  _ <- takeNews session
  go (emptyModel, 0, []) these
 where
  go _ [] = pure True
  go (model, time, starts) (it : others) = case it of
    Passes seconds -> do
      say ("after " ++ show seconds)
      setTime admin (time + seconds)
      go (model, time + seconds, starts) others
    NewEpoch -> do
      say "new epoch"
      void (query_ admin "select fleet.new_epoch()" :: IO [Only Int])
      -- (The notices of another connection come with the next answer.)
      _ <- ask session (Look [])
      _ <- takeNews session
      go (newEpoch time model, time, starts) others
    Asks f -> case f starts of
      asked@(Asked request shown) -> do
        there <- ask session request
        news <- takeNews session
        let (here, after, newsHere) = perform time request model
            (one, other) = (given shown there news, given shown here newsHere)
        say (describe asked ++ "\n   PostgreSQL: " ++ show one ++ "\n   model:      " ++ show other)
        if one /= other then pure False else go (after, time, newStarts request here ++ starts) others
  newStarts :: Request r -> Either Refusal r -> [Start]
  newStarts (Claim _) (Right those) = reverse those
  newStarts (CompleteAndClaim _ _) (Right (_, those)) = reverse those
  newStarts _ _ = []
  say text = modifyIORef' said (text :)
