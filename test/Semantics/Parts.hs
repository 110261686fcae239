{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Programs as trees: their parts, and how to replace them.
module Semantics.Parts
  ( parts
  , rebuild
  , depth
  , resignal
  ) where

import Data.Bifunctor (first)

import Semantics.Program

-- | The direct parts of a program, those of its signals first.
parts :: Program -> [Program]
parts = \case
  Do _ _ -> []
  Pure _ -> []
  Then a b -> [a, b]
  Else a b -> [a, b]
  Attempt _ a -> [a]
  FallbackOver as -> as
  Parallel a b -> [a, b]
  Both a b -> [a, b]
  FirstOf as -> as
  AllOf as -> as
  Decide _ as b -> as ++ [b]
  RSelect s a b -> ofSignal s ++ [a, b]
  Monitor s a b -> ofSignal s ++ [a, b]
  InsteadWhen s a b -> ofSignal s ++ [a, b]
  Switch s as -> ofSignal s ++ as
  TeleoReactive rules -> concat [ofSignal s ++ [a] | (s, a) <- rules]
  WaitUntil s -> ofSignal s
  WhileHolding s a -> ofSignal s ++ [a]
  Timeout _ a -> [a]
  WithShared s a -> ofSignal s ++ [a]
  Scoped a -> [a]
  Fork a -> [a]
  Await a b -> [a, b]
  StopChild a b -> [a, b]

ofSignal :: Signal -> [Program]
ofSignal = \case
  Watched _ -> []
  Polled _ a -> [a]
  And s s' -> ofSignal s ++ ofSignal s'
  Hysteresis _ _ _ s -> ofSignal s
  Debounce _ s -> ofSignal s
  Throttle _ s -> ofSignal s
  StaleAfter _ s -> ofSignal s
  Shared -> []

-- | The program with other parts, as many as it has.
rebuild :: Program -> [Program] -> Program
rebuild p new = case (p, new) of
  (Then _ _, [a, b]) -> Then a b
  (Else _ _, [a, b]) -> Else a b
  (Attempt n _, [a]) -> Attempt n a
  (FallbackOver _, as) -> FallbackOver as
  (Parallel _ _, [a, b]) -> Parallel a b
  (Both _ _, [a, b]) -> Both a b
  (FirstOf _, as) -> FirstOf as
  (AllOf _, as) -> AllOf as
  (Decide choice _ _, as@(_ : _)) -> Decide choice (init as) (last as)
  (RSelect s _ _, as) | (s', [a, b]) <- sensing s as -> RSelect s' a b
  (Monitor s _ _, as) | (s', [a, b]) <- sensing s as -> Monitor s' a b
  (InsteadWhen s _ _, as) | (s', [a, b]) <- sensing s as -> InsteadWhen s' a b
  (Switch s _, as) | (s', bs) <- sensing s as -> Switch s' bs
  (TeleoReactive rules, as) -> TeleoReactive (ruled rules as)
  (WaitUntil s, as) -> WaitUntil (fst (sensing s as))
  (WhileHolding s _, as) | (s', [a]) <- sensing s as -> WhileHolding s' a
  (Timeout n _, [a]) -> Timeout n a
  (WithShared s _, as) | (s', [a]) <- sensing s as -> WithShared s' a
  (Scoped _, [a]) -> Scoped a
  (Fork _, [a]) -> Fork a
  (Await _ _, [a, b]) -> Await a b
  (StopChild _ _, [a, b]) -> StopChild a b
  _ -> p
 where
  ruled ((s, _) : rules) as | (s', a : as') <- sensing s as = (s', a) : ruled rules as'
  ruled _ _ = []

-- | The signal with other programs, and the programs that are left.
sensing :: Signal -> [Program] -> (Signal, [Program])
sensing signal as = case (signal, as) of
  (Polled n _, a : others) -> (Polled n a, others)
  (And s s', _) -> let (new, others) = sensing s as in first (And new) (sensing s' others)
  (Hysteresis initially low high s, _) -> first (Hysteresis initially low high) (sensing s as)
  (Debounce n s, _) -> first (Debounce n) (sensing s as)
  (Throttle n s, _) -> first (Throttle n) (sensing s as)
  (StaleAfter n s, _) -> first (StaleAfter n) (sensing s as)
  _ -> (signal, as)

-- | The depth of a program.
depth :: Program -> Int
depth p = maximum (0 : map ((+ 1) . depth) (parts p))

-- | The programs in which one signal is replaced.
resignal :: (Signal -> [Signal]) -> Program -> [Program]
resignal with = \case
  RSelect s a b -> [RSelect s' a b | s' <- with s]
  Monitor s a b -> [Monitor s' a b | s' <- with s]
  InsteadWhen s a b -> [InsteadWhen s' a b | s' <- with s]
  Switch s as -> [Switch s' as | s' <- with s]
  TeleoReactive rules ->
    [ TeleoReactive (take n rules ++ [(s', a)] ++ drop (n + 1) rules)
    | (n, (s, a)) <- zip [0 ..] rules
    , s' <- with s
    ]
  WaitUntil s -> [WaitUntil s' | s' <- with s]
  WhileHolding s a -> [WhileHolding s' a | s' <- with s]
  WithShared s a -> [WithShared s' a | s' <- with s]
  _ -> []
