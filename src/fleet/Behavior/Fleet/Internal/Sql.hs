{-# OPTIONS_HADDOCK not-home #-}
{-# OPTIONS_GHC -Wno-orphans #-}
{-# LANGUAGE GADTs #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE RankNTypes #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- The functions of the schema, called.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Sql
  ( called
  ) where

import Control.Exception (throwIO)
import Control.Monad (void, (>=>))
import Data.Bifunctor (bimap)
import Data.Char (toLower)
import Data.Either (partitionEithers)
import Data.Int (Int64)
import Data.Maybe (fromMaybe, listToMaybe)
import qualified Data.Set as Set
import Data.Text (Text)
import qualified Data.Text as Text
import Database.PostgreSQL.Simple
import Database.PostgreSQL.Simple.ToField (ToField (..))
import Database.PostgreSQL.Simple.Types (PGArray (..), fromPGArray)

import Behavior (Seconds)
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Error (ConnectionLost (..))

-- | Calls the function of the schema with these arguments.
called :: Connection -> Request r -> IO r
called connection = \case
  Connect (Number greatest) ->
    one "select coalesce(version, 0), coalesce(epoch, 0) from fleet.connect(?)" (Only greatest)
  Submit it ->
    TaskNumber . fromOnly
      <$> one
        "select fleet.submit(?, ?, ?, ?, fleet.clock() + ?::float8 * interval '1 s', \
        \fleet.clock() + ?::float8 * interval '1 s', ?::text[], ?::float8 * interval '1 s', \
        \array(select unnest(?::float8[]) * interval '1 s'), ? * interval '1 s')"
        ( (toQueue it, withKey it, taskInput it, withPriority it, notBefore it, notAfter it)
            :. (texts (Set.toList (withNeeds it)), withPeriod it, PGArray (withPauses it), keptFor it)
        )
  Claim it ->
    map start
      <$> query
        connection
        "select * from fleet.claim(?, ?::text[], ?::text[], ? * interval '1 s', ?, ?)"
        (claim it)
  Renew leases ->
    map renewed
      <$> query
        connection
        "select * from fleet.renew(?::bigint[], ?::bigint[])"
        (PGArray (map fst leases), PGArray (map snd leases))
  Complete ends ->
    map completed
      <$> query
        connection
        "select * from fleet.complete_some(?::bigint[], ?::bigint[], ?::jsonb[])"
        (PGArray [t | (t, _, _) <- ends], PGArray [n | (_, n, _) <- ends], PGArray [it | (_, _, it) <- ends])
  CompleteAndClaim ends it ->
    partitionEithers . map isHere
      <$> query
        connection
        "select * from fleet.complete_and_claim(?::bigint[], ?::bigint[], ?::jsonb[], ?, ?::text[], ?::text[], \
        \? * interval '1 s', ?, ?)"
        ( (PGArray [t | (t, _, _) <- ends], PGArray [n | (_, n, _) <- ends], PGArray [gave | (_, _, gave) <- ends])
            :. claim it
        )
  Fail task lease why -> nothing "select fleet.fail(?, ?, ?)" (task, lease, why)
  GiveBack task lease -> nothing "select fleet.give_back(?, ?)" (task, lease)
  Report task lease what -> nothing "select fleet.report(?, ?, ?)" (task, lease, what)
  Became task lease ->
    one "select fleet.became(?, ?)" (task, lease) >>= \case
      Only ("running" :: Text) -> pure StillRuns
      Only "completed" -> pure IsCompleted
      Only _ -> pure IsLost
  Look tasks ->
    map looked
      <$> query
        connection
        "select task, state::text, starts, progress, result, array(select r ->> 'reason' from \
        \jsonb_array_elements(reasons) r) from fleet.look(?::bigint[])"
        (Only (PGArray tasks))
  Find name key -> fmap TaskNumber . fromOnly <$> one "select fleet.number_of(?, ?)" (name, key)
  Cancel name key -> (fromOnly >=> stateOf) <$> one "select fleet.cancel(?, ?)::text" (name, key)
  Retry name key -> fromOnly <$> one "select fleet.retry(?, ?)" (name, key)
  ListDead name ->
    map dead
      <$> query
        connection
        "select key, starts, array(select r ->> 'reason' from jsonb_array_elements(reasons) r) from fleet.list_dead(?)"
        (Only name)
  Hold wish ->
    one
      "select * from fleet.hold(?, ?::text[], ?, ? * interval '1 s')"
      (wishNumber wish, texts (Set.toList (wishFor wish)), wishRobot wish, wishTerm wish)
      >>= \case
        (Just names, Just fences, _) -> pure (Holds (zip (fromPGArray names) (map Number (fromPGArray fences))))
        (_, _, again) -> pure (AskAgainIn (maybe 0.1 seconds again))
  Keep wishes -> map fromOnly <$> query connection "select fleet.keep(?::uuid[])" (Only (PGArray wishes))
  Release wish -> nothing "select fleet.release(?)" (Only wish)
  Poll it ->
    bimap (fmap seconds) fromPGArray
      <$> one
        "select * from fleet.poll(?, null, ?, ?::text[], ? * interval '1 s')"
        (process it, itsPage it, texts (itsRobots it), everySeconds it)
  Leave it -> nothing "select fleet.leave(?)" (Only it)
 where
  one :: (ToRow q, FromRow r) => Query -> q -> IO r
  one how with =
    query connection how with >>= maybe (throwIO (ConnectionLost "a function has given no row")) pure . listToMaybe
  nothing :: ToRow q => Query -> q -> IO ()
  nothing how with = void (query connection how with :: IO [Only ()])
  claim it =
    ( fromQueue it
    , texts (forRobots it)
    , texts (Set.toList (withSkills it))
    , forTerm it
    , claimNumber it
    , isAgain it
    )
  start (task, lease, robot, key, input, count) = Start (TaskNumber task) (Number lease) robot key input count
  isHere (task, lease, theRobot, theKey, theInput, theCount) = case (theRobot, theKey, theInput, theCount) of
    (Just robot, Just key, Just input, Just count) -> Right (start (task, lease, robot, key, input, count))
    _ -> Left (TaskNumber task, Number lease)
  renewed (task, lease, isCancelled) = (TaskNumber task, Number lease, isCancelled)
  completed (task, lease) = (TaskNumber task, Number lease)
  looked (task, its, count, how, gave, whys) =
    (TaskNumber task, Task (fromMaybe Waiting (stateOf its)) count how gave (fromPGArray whys))
  dead (key, count, whys) = (key, Task Dead count Nothing Nothing (fromPGArray whys))
  texts = PGArray

-- | The word of the schema.
stateOf :: Text -> Maybe TaskState
stateOf word = lookup (Text.unpack word) [(map toLower (show s), s) | s <- [minBound ..]]

seconds :: Double -> Seconds
seconds = realToFrac

instance ToField Seconds where
  toField = toField . (realToFrac :: Seconds -> Double)

instance ToField TaskNumber where
  toField (TaskNumber n) = toField (n :: Int64)

instance ToField Number where
  toField (Number n) = toField (n :: Int64)
