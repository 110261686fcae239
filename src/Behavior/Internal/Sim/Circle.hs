{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- What goes round in circles in a livelock.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Circle
  ( circles
  ) where

import Data.List (intercalate, nub)
import qualified Data.Map.Strict as Map
import Data.Maybe (mapMaybe)

import Behavior.Internal.SafeText
import Behavior.Internal.Seconds (Seconds)
import Behavior.Internal.Trace.Event

-- | For each operator that has reacted more than once at this time: how often, the values to which it
-- reacted, and what it started. The events are given latest first.
circles :: Seconds -> [Event] -> [String]
circles now' latestFirst = [described rs | rs@(_ : _ : _) <- Map.elems reactions]
 where
  reactions = Map.fromListWith (++) [((reactionParent r, reactionOperator r), [r]) | Reacted r <- recent]
  recent = takeWhile happensNow latestFirst
  happensNow = \case
    Began s -> spanBegan s >= now'
    Ended _ t _ -> t >= now'
    Reacted r -> reactionTime r >= now'
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

-- | The first of them, each once.
some :: [String] -> String
some texts = case splitAt 4 (nub (take 100 texts)) of
  (these, []) -> intercalate ", " these
  (these, _) -> intercalate ", " these ++ " ..."
