{-# LANGUAGE OverloadedStrings #-}

-- |
-- What the marks of a timeline mean.
module Behavior.Trace.Svg.Legend
  ( Used (..)
  , legend
  ) where

import qualified Data.Text as Text
import Graphics.Svg.Core (Element)

import Behavior.Trace.Svg.Draw
import Behavior.Trace.Svg.Interruptions
import Behavior.Trace.Svg.Outcome

-- | What a timeline contains.
data Used = Used
  { usedOutcomes :: [SpanOutcome]
  , usedStopping :: !Bool
  -- ^ A part of a bar shows that it was being stopped.
  , usedChanges :: [Effect]
  , usedOnward :: !Bool
  -- ^ An arrow leads from what was stopped to what started.
  , usedPauses :: !Bool
  , usedMerged :: !Bool
  -- ^ Marks for several spans.
  }

-- | What the marks mean that the timeline contains, between those pixels; and how much room the lines take after the
-- first.
legend :: Double -> Double -> Used -> (Element, Double)
legend left right used = (group "le" (concat drawn), maximum (0 : downs))
 where
  (drawn, downs) = unzip [(entryDrawn entry x down, down) | (entry, (x, down)) <- zip entries places]
  entryDrawn (draw, word) x down = [draw x (73 + down), textAt "q" (x + 32) (84 + down) [("", word)]]
  places = scanl after (left, 0) (zip entries (drop 1 entries))
  -- Where the next one is.
  after (x, down) (entry, next)
    | x' + wide next <= right = (x', down)
    | otherwise = (left, down + 20)
   where
    x' = x + wide entry + 16
  wide (_, word) = 32 + textWidth word
  entries =
    concatMap
      (map snd . filter fst)
      [ map
          outcome
          [ (Success, "succeeded")
          , (RanAgain, "succeeded, but ran again")
          , (CutShort, "ended by a signal")
          , (Failure, "failed")
          , (Fault, "faulted")
          , (Stop, "stopped")
          ]
      , [(usedStopping used, (\x y -> shape "h" (barShape Stop x y 26 13), "while stopping"))]
      , [outcome (Running, "not ended")]
      , [(usedPauses used, (pauseSample, "waiting, or unnamed"))]
      , [ change (Interrupts, "a signal changed → stopped")
        , (usedOnward used, (onwardSample, "then started"))
        , change (OnlyStarts, "a signal changed → started")
        ]
      , [(usedMerged used, (several, "short spans, together"))]
      ]
  change (e, word) = (e `elem` usedChanges used, (\x y -> arrowSample e x (y + 6.5), word))
  onwardSample x y = shape "ar" (bracket 9 (x + 4, x + 22) (y + 2))
  pauseSample x y = shape "wt" (Text.concat ["M", px (x + 2), " ", px (y + 6.5), "H", px (x + 25)])
  outcome (o, word) =
    ( o `elem` usedOutcomes used
    , (\x y -> path (Text.unwords ["b", outcomeClass o]) (barShape o x y 26 13) mempty, word)
    )
  several x y =
    group
      ""
      ( shape "m v2 s" (markShape Success x y 26 13)
          : [shape "m f" (markShape Failure (x + 8) y 2 13) | Failure `elem` usedOutcomes used]
      )
