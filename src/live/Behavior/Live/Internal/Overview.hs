{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- What a hub says of all its robots: one message, which is always whole. @docs\/live-protocol.md@ describes each field.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Overview
  ( overview
  ) where

import Control.Applicative ((<|>))
import Data.Aeson.Encoding (Encoding, Series, double, int, list, pair, pairs)
import qualified Data.Aeson.Encoding as Encoding
import Data.ByteString.Builder (toLazyByteString)
import qualified Data.ByteString.Lazy as Bytes
import qualified Data.IntMap.Strict as IntMap
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Text (Text)

import Behavior.Live.Internal.Known
import Behavior.Live.Internal.Robots
import Behavior.Trace.Json (text, written)

-- | The message, given the name of the hub, the time by the clock that is never set, what has come of each robot, and
-- how many robots are not followed.
overview :: String -> Double -> Map Text Seen -> Int -> Bytes.ByteString
overview hub time robots more =
  toLazyByteString . written . pairs $
    pair "message" (text "robots")
      <> pair "hub" (text hub)
      <> pair "robots" (list (uncurry (robotRow time)) (Map.toList robots))
      <> pair "others" (int more)

robotRow :: Double -> Text -> Seen -> Encoding
robotRow time name robot =
  pairs $
    pair "name" (Encoding.text name)
      <> standing time robot
      <> pair "now" (double (timeThere it))
      <> pair "running" (list one (take mostShown runs))
      <> pair "more" (int (length (drop mostShown runs)))
      <> foldMap (pair "interruption" . interrupted it) (interruption it)
 where
  it = known robot
  runs = doing it
  one (Doing path began) = pairs (pair "path" (list Encoding.text path) <> pair "began" (double began))
  mostShown = 5

-- A robot that is stopped closes nothing: it only falls silent. (Of the next two beats none has come.)
standing :: Double -> Seen -> Series
standing time robot
  | isOver (known robot) = state "over"
  | Just why <- refused (known robot) = state "refused" <> pair "why" (Encoding.text why)
  | Just why <- problem robot = away <> pair "why" (text why)
  | otherwise = case lastCame robot of
      Nothing -> state "connecting"
      Just (came, _) | time - came <= 0.7 -> state "live"
      _ -> away
 where
  state kind = pair "state" (text kind)
  away = state "disconnected" <> foldMap (pair "since" . double . fromIntegral . milliseconds . snd) (lastCame robot)
  milliseconds t = floor (1000 * t) :: Integer

-- With the names of what was stopped and started, where they are known; otherwise those of the branches.
interrupted :: Known -> Interruption -> Encoding
interrupted it this =
  pairs $
    pair "time" (double (reactedAt this))
      <> pair "operator" (Encoding.text (operator this))
      <> pair "changes" (list change (changes this))
      <> pair "stopped" (Encoding.text what)
      <> pair "after" (double ran)
      <> foldMap (pair "starts" . Encoding.text) (IntMap.lookup (reaction this) (startedBy it) <|> starts this)
 where
  (what, ran) = case IntMap.lookup (reaction this) (stoppedBy it) of
    Just (Stopped _ name began) -> (name, reactedAt this - began)
    Nothing -> (stops this, after this)
  change (Change signal before now) =
    pairs $
      pair "signal" (Encoding.text signal) <> foldMap (pair "before" . Encoding.text) before
        <> pair "after" (Encoding.text now)
