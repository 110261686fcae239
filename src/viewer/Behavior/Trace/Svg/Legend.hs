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
import Behavior.Trace.Svg.Layout

-- | What a timeline contains.
data Used = Used
  { usedOutcomes :: [Outcome]
  , usedStopping :: !Bool
  -- ^ A part of a bar shows that it was being stopped.
  , usedChanges :: [Effect]
  , usedMerged :: !Bool
  -- ^ Marks for several spans.
  }

-- | What the marks mean that the timeline contains, from that pixel on.
legend :: Double -> Used -> Element
legend margin used = group "le" (fst (foldl entry ([], margin) entries))
 where
  entry (done, left) (draw, word) =
    (done ++ [draw left, textAt "q" (left + 32) 84 [("", word)]], left + 32 + textWidth word + 16)
  entries =
    concatMap
      (map snd . filter fst)
      [ map outcome [(Success, "succeeded"), (Failure, "failed"), (Fault, "faulted"), (Stop, "stopped")]
      , [(usedStopping used, (\left -> shape "h" (barShape Stop left 73 26 13), "while stopping"))]
      , [outcome (Running, "not ended")]
      , [(e `elem` usedChanges used, (\left -> arrowSample e left 79.5, word)) | (e, word) <- changes]
      , [(usedMerged used, (several, "short spans, together"))]
      ]
  changes = [(Interrupts, "a signal changed → stopped → started"), (OnlyStarts, "a signal changed → started")]
  outcome (o, word) =
    (o `elem` usedOutcomes used, (\left -> path (Text.unwords ["b", outcomeClass o]) (barShape o left 73 26 13) mempty, word))
  several left =
    group "" (shape "m v2 s" (markShape Success left 73 26 13) : [shape "m f" (markShape Failure (left + 8) 73 2 13) | Failure `elem` usedOutcomes used])
