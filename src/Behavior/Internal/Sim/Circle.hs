{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- What goes round in circles in a livelock.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Circle
  ( circles
  ) where

import qualified Data.IntSet as IntSet
import Data.List (intercalate, nub)
import qualified Data.Map.Strict as Map
import Data.Maybe (mapMaybe)

import Behavior.Internal.Core.SafeText
import Behavior.Internal.Core.Seconds (Seconds)
import Behavior.Internal.Spans.Event

-- | For each operator that has reacted again and again at this time, and has not ended: how often, the values to
-- which it reacted, and what it started. The events are given latest first. (An operator that has reacted less than
-- once in a thousand of the scheduling points that the limit allows is not what uses them up.)
circles :: Int -> Seconds -> [Event] -> [String]
circles limit moment latestFirst =
  [ described rs
  | ((Inside operator, _), rs@(_ : _ : _)) <- Map.toList reactions
  , 1000 * length rs >= limit
  , not (IntSet.member operator ended)
  ]
 where
  ended = IntSet.fromList [spanNumber s | Ended s _ _ <- recent]
  reactions = Map.fromListWith (++) [((reactionParent r, reactionOperator r), [r]) | Reacted r <- recent]
  recent = takeWhile happensNow latestFirst
  happensNow = \case
    Began s -> spanBegan s >= moment
    Ended _ t _ -> t >= moment
    Reacted r -> reactionTime r >= moment
    Lost _ -> True

described :: [Reaction] -> String
described rs =
  intercalate ", " $
    (operator ++ " reacted " ++ show (length rs) ++ " times")
      : [word ++ some texts | (word, texts) <- [("to ", values), ("and started ", starts)], not (null texts)]
 where
  operator = concatMap (safeShow . reactionOperator) (take 1 rs)
  values = [safeShow (changeSignal c) ++ " " ++ safeShow (changeAfter c) | r <- rs, c <- reactionChanges r]
  starts = map safeShow (mapMaybe reactionStarts rs)

-- | The first few of the texts, each once.
some :: [String] -> String
some texts = case splitAt 4 (nub (take 100 texts)) of
  (these, []) -> intercalate ", " these
  (these, _) -> intercalate ", " these ++ " ..."
