{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Smaller programs and worlds.
module Semantics.Shrink
  ( shrinkWorld
  ) where

import Test.QuickCheck

import Semantics.Parts
import Semantics.Program
import Semantics.Source (usesShared, signals)

-- | Smaller worlds of the same kind.
shrinkWorld :: World -> [World]
shrinkWorld world =
  [world {program = p} | p <- shrinkProgram (program world), not (illScoped p)]
    ++ [world {changes = some} | some <- shrinkList shrinkChange (changes world)]
    ++ [world {caller = Operator} | caller world /= Operator]
    ++ [world {slippage = n} | n <- shrink (slippage world)]
    ++ [world {cancelAt = n} | n <- shrink (cancelAt world), n > 0]
 where
  shrinkChange (Change at condition level) =
    [Change at condition (At 0) | level `notElem` [At 0, At 1]] ++ [Change at' condition level | at' <- earlier at]
  earlier at = [at - 1 | at > 0, all (\(Change other _ _) -> other <= at - 1 || other >= at) (changes world)]

-- | Whether a fork is outside of every scope, or a shared signal outside of its
-- 'WithShared'. (A fork must not leave a 'WithShared', which it would outlive.)
illScoped :: Program -> Bool
illScoped = go False False
 where
  go inScope sharing p = case p of
    Fork a -> not inScope || go inScope sharing a
    Await a b -> not inScope || any (go inScope sharing) [a, b]
    StopChild a b -> not inScope || any (go inScope sharing) [a, b]
    Scoped a -> go True sharing a
    WithShared s a -> ofSignals inScope sharing [s] || go False True a
    _ -> ofSignals inScope sharing (signals p) || any (go inScope sharing) (parts p)
  ofSignals inScope sharing ss =
    not sharing && any usesShared ss || any (any (go inScope sharing) . parts . WaitUntil) ss

shrinkProgram :: Program -> [Program]
shrinkProgram p = parts p ++ outer ++ inner
 where
  inner =
    [ rebuild p (take n ps ++ [q'] ++ drop (n + 1) ps)
    | let ps = parts p
    , (n, q) <- zip [0 ..] ps
    , q' <- shrinkPart q
    ]
  -- The action that takes time, without which a recovery repeats for ever, is kept.
  shrinkPart q = case (p, q) of
    (Monitor {}, Then first second) -> Then first <$> shrinkProgram second
    _ -> shrinkProgram q
  outer = case p of
    Do name scripts -> [Do name some | some <- shrinkList simpler scripts, not (null some)]
    Pure Unit -> []
    Pure _ -> [Pure Unit]
    FallbackOver as -> FallbackOver <$> without as
    FirstOf as -> FirstOf <$> without as
    AllOf as -> AllOf <$> without as
    Decide choice as b -> (\some -> Decide choice some b) <$> without as
    TeleoReactive rules -> TeleoReactive <$> without rules
    Attempt n a -> [Attempt (n - 1) a | n > 1]
    _ -> resignal shrinkSignal p
  without xs = [take n xs ++ drop (n + 1) xs | n <- [0 .. length xs - 1]]
  simpler s =
    [s {masking = Unmasked} | masking s /= Unmasked]
      ++ [s {onStop = StopsAtOnce} | onStop s /= StopsAtOnce]
      ++ [s {ends = Succeeds 0} | ends s /= Succeeds 0]
      ++ [s {takes = takes s - 1} | takes s > 1]

shrinkSignal :: Signal -> [Signal]
shrinkSignal = \case
  Watched _ -> []
  Polled n a -> Watched "p" : [Polled (n - 1) a | n > 1]
  And a b -> [a, b] ++ [And a' b | a' <- shrinkSignal a] ++ [And a b' | b' <- shrinkSignal b]
  Hysteresis initially low high s -> s : (Hysteresis initially low high <$> shrinkSignal s)
  Debounce n s -> s : (Debounce n <$> shrinkSignal s)
  Throttle n s -> s : (Throttle n <$> shrinkSignal s)
  StaleAfter n s -> s : (StaleAfter n <$> shrinkSignal s)
  Shared -> [Watched "p"]
