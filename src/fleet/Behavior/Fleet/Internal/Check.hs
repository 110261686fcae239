{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE GADTs #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- What is asked of no database: durations that are no numbers, and text that PostgreSQL cannot store.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Check
  ( whyNot
  , whyNotRobot
  ) where

import Control.Applicative ((<|>))
import Data.Aeson (Value (..))
import qualified Data.Aeson.Key as Key
import qualified Data.Aeson.KeyMap as KeyMap
import Data.Foldable (asum, toList)
import Data.Maybe (listToMaybe)
import qualified Data.Set as Set
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Seconds)
import Behavior.Fleet.Internal.Contract

-- | Why this request is not allowed, if that can be said without the database.
whyNot :: Request r -> Maybe Text
whyNot = \case
  Submit it ->
    texts [toQueue it, withKey it]
      <|> texts (Set.toList (withNeeds it))
      <|> json (taskInput it)
      <|> durations (keptFor it : withPauses it ++ concatMap toList [notBefore it, notAfter it, withPeriod it])
  Claim it -> texts (fromQueue it : forRobots it) <|> texts (Set.toList (withSkills it)) <|> durations [forTerm it]
  Complete ends -> asum [json gave | (_, _, gave) <- ends]
  CompleteAndClaim ends it -> whyNot (Complete ends) <|> whyNot (Claim it)
  Report _ _ what -> json what
  Find name key -> texts [name, key]
  Cancel name key -> texts [name, key]
  Retry name key -> texts [name, key]
  ListDead name -> texts [name]
  Hold wish -> texts (wishRobot wish : Set.toList (wishFor wish)) <|> durations [wishTerm wish]
  Poll it -> texts (itsRobots it) <|> texts (toList (itsPage it))
  _ -> Nothing

-- | Why no robot may have this name and these skills.
whyNotRobot :: Text -> [Text] -> Maybe Text
whyNotRobot name its =
  listToMaybe
    [ what <> " has 1 to " <> Text.pack (show most) <> " characters, and has no character U+0000: " <> shown it
    | (what, most, it) <- ("the name of a robot", 200, name) : map ((,,) "a skill" 50) its
    , Text.null it || Text.length it > most || Text.any (== '\0') it
    ]

texts :: [Text] -> Maybe Text
texts them = listToMaybe ["a text has no character U+0000: " <> shown it | it <- them, Text.any (== '\0') it]

shown :: Text -> Text
shown it = Text.pack (show (Text.take 50 it))

json :: Value -> Maybe Text
json = \case
  String it -> texts [it]
  Array them -> asum (json <$> toList them)
  Object fields -> asum [texts [Key.toText key] <|> json value | (key, value) <- KeyMap.toList fields]
  _ -> Nothing

durations :: [Seconds] -> Maybe Text
durations them =
  listToMaybe ["a duration is a finite number of seconds, not " <> Text.pack (show it) | it <- them, not (isFinite it)]
 where
  isFinite it = it - it == 0
