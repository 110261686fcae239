{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE GADTs #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- What the schema does, as a pure function: for tests without a database. (The same requests are tried with both.)
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Model
  ( Model
  , perform
  , newEpoch
  , allTasks
  ) where

import Control.Monad (forM_, when)
import Control.Monad.Trans.Except (runExceptT)
import Control.Monad.Trans.State.Strict (execState, runState)
import Data.List (sortOn)
import qualified Data.Map.Strict as Map
import qualified Data.Set as Set
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Seconds)
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Model.Claims
import Behavior.Fleet.Internal.Model.Resources
import Behavior.Fleet.Internal.Model.Tables
import Behavior.Fleet.Internal.Model.Tasks
import Behavior.Fleet.Internal.Version (newest)

-- | One function of the schema, at this time of the database: what it gives, the tables, and the notices.
perform :: Seconds -> Request r -> Model -> (Either Refusal r, Model, [Notice])
perform at wanted before = case runState (runExceptT (doing at wanted)) before {said = []} of
  (Left refusal, _) -> (Left refusal, before, [])
  (Right r, after) -> (Right r, after {said = []}, reverse (said after))

doing :: Seconds -> Request r -> Doing r
doing at = \case
  Connect n -> do
    latest <- getting nextNumber
    when (n > latest && n `div` perEpoch > floor (at + 86400)) . refuse $
      "no database can have given the number " <> Text.pack (show (toInteger n)) <> " yet"
    change (\m -> if nextNumber m <= n then m {isRestored = True, seen = max n (seen m)} else m)
    (,) newest <$> getting epoch
  Submit it -> requireEpoch >> submit at it
  Claim it -> requireEpoch >> claim at it
  Renew starts -> requireEpoch >> concat <$> traverse (uncurry (renew at)) starts
  Complete ends -> requireEpoch >> completeSome ends
  CompleteAndClaim ends it -> requireEpoch >> (,) <$> completeSome ends <*> claim at it
  Fail n l why -> running n l >>= \row -> startEnded at n row why True
  GiveBack n l -> running n l >>= \row -> startEnded at n row "given back" False
  Report n l what -> running n l >>= \row -> put n row {task = (task row) {taskProgress = Just what}} >> tellTask n row
  Became n l -> requireEpoch >> became n l
  Look numbers -> requireEpoch >> look numbers
  Find name its -> requireEpoch >> fmap fst <$> find name its its
  Cancel name its -> requireEpoch >> cancel at name its
  Retry name its -> requireEpoch >> retryDead name its
  ListDead name -> requireEpoch >> listDead name
  Hold it -> requireEpoch >> hold at it
  Keep wishes -> requireEpoch >> keep at wishes
  Release number -> release at number
  Poll it -> do
    requireEpoch
    requireRobots (itsRobots it)
    when (everySeconds it < 0 || everySeconds it > 86400) $
      refuse "a process has a number of its own, and polls every 0 seconds to 1 day"
    change (\m -> m {places = Map.filter ((>= at - 60) . placeUntil) (places m)})
    next <- sweep at
    waiting <- getting (filter ((== Waiting) . taskState . task) . Map.elems . rows)
    pure (next, Set.toList (Set.fromList (map (toQueue . submitted) waiting)))
  Leave _ -> pure ()
 where
  completeSome ends = concat <$> traverse (\(n, l, gave) -> complete at n l gave) (sortOn (\(n, _, _) -> n) ends)

-- | What @behavior-fleet new-epoch@ does.
newEpoch :: Seconds -> Model -> Model
newEpoch at = execState . runExceptT $ do
  change (\m -> m {epoch = next m, isRestored = False, places = Map.empty})
  first <- getting (\m -> fromIntegral (epoch m) * perEpoch)
  change (\m -> m {nextNumber = Number first, nextRow = TaskNumber first})
  started <- getting (filter ((== Running) . taskState . task . snd) . Map.toList . rows)
  forM_ started $ \(n, row) -> startEnded at n row "the database was restored from a copy" False
  change (\m -> m {holdsFrom = at + maximum (60 : map holderTerm (Map.elems (resources m)))})
  change (\m -> m {resources = (\h -> h {heldUntil = holdsFrom m, holderRequest = Nothing}) <$> resources m})
 where
  next m = maximum (floor at : epoch m + 1 : [fromIntegral (n `div` perEpoch) + 1 | n <- [seen m, nextNumber m - 1]])

-- | The tasks, in order: queue, key, and what is known.
allTasks :: Model -> [(Text, Text, Task)]
allTasks model = [(toQueue (submitted row), key row, task row) | row <- Map.elems (rows model)]
