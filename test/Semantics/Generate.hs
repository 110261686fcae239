{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Random programs and worlds.
--
-- Durations are few and small, so that ties are frequent.
module Semantics.Generate
  ( worlds
  , smallWorlds
  ) where

import Data.List (sortOn)
import Test.QuickCheck

import Semantics.Parts
import Semantics.Program

-- | Worlds with programs up to the given depth.
worlds :: Int -> Gen World
worlds deep = do
  levels' <- traverse (\c -> (,) c <$> frequency [(14, At <$> choose (0, 1)), (1, pure NoValue)]) known
  World levels' <$> someChanges <*> choose (4, 16) <*> (renamed <$> programs deep) <*> callers <*> pure 0
 where
  someChanges = do
    n <- choose (0, 8)
    inOrder <$> vectorOf n (Change <$> choose (0, 8) <*> elements known <*> someLevel)
  someLevel = frequency [(30, At <$> choose (0, 2)), (1, pure NoValue), (1, pure Failing), (1, pure Faulting)]

-- | Worlds that are small enough to try all their schedules.
smallWorlds :: Gen World
smallWorlds = do
  first <- At <$> choose (0, 1)
  n <- choose (0, 2)
  changes' <- inOrder <$> vectorOf n (Change <$> choose (0, 2) <*> pure "p" <*> someLevel)
  World [("p", first), ("q", At 0)] changes' <$> choose (2, 4) <*> (renamed <$> programs 1) <*> callers <*> pure 0
 where
  someLevel = frequency [(4, At <$> choose (0, 1)), (1, pure NoValue)]

callers :: Gen Caller
callers = frequency [(3, pure Operator), (1, PlainThread <$> elements [Asynchronous, Synchronous] <*> choose (0, 3))]

inOrder :: [Change] -> [Change]
inOrder = sortOn (\(Change at _ _) -> at)

known :: [Condition]
known = ["p", "q"]

-- | Programs up to the given depth, outside of any scope.
programs :: Int -> Gen Program
programs = within' False False

-- | Programs that may fork if the first argument is true, and that may use the shared signal
-- if the second is.
within' :: Bool -> Bool -> Int -> Gen Program
within' inScope sharing = go
 where
  go :: Int -> Gen Program
  go 0 =
    frequency $
      [ (30, action)
      , (1, Pure . Number <$> choose (0, 2))
      , (1, WaitUntil <$> signal 0)
      ]
        ++ [ choice
           | inScope
           , choice <- [(8, Fork <$> action), (4, Await <$> action <*> action), (2, StopChild <$> action <*> action)]
           ]
  go n =
    frequency $
      [ (1, go 0)
      , (4, Then <$> less <*> less)
      , (3, Else <$> less <*> less)
      , (1, Attempt <$> choose (0, 3) <*> less)
      , (1, FallbackOver <$> few less)
      , (2, Parallel <$> less <*> less)
      , (2, Both <$> less <*> less)
      , (2, FirstOf <$> few less)
      , (2, AllOf <$> few less)
      , (3, Decide <$> choices <*> few less <*> less)
      , (4, RSelect <$> sensed <*> less <*> less)
      , (5, Monitor <$> sensed <*> takingTime less <*> less)
      , (3, InsteadWhen <$> sensed <*> less <*> less)
      , (2, Switch <$> sensed <*> few1 less)
      , (2, TeleoReactive <$> few ((,) <$> sensed <*> less))
      , (1, WaitUntil <$> sensed)
      , (2, WhileHolding <$> sensed <*> less)
      , (2, Timeout <$> frequency [(1, pure 0), (9, choose (1, 6))] <*> less)
      , (2, Scoped <$> within' True sharing (n - 1))
      , (2, WithShared <$> sensed <*> within' False True (n - 1))
      ]
        ++ [ choice
           | inScope
           , choice <- [(3, Fork <$> less), (3, Await <$> less <*> less), (2, StopChild <$> less <*> less)]
           ]
   where
    less = frequency [(1, choose (0, n - 1)), (2, pure (n - 1))] >>= go
    sensed = signal (n - 1)
    choices = frequency [(8, AtLeast <$> choose (0, 3)), (2, pure FirstEnd), (1, pure NoChoice)]
    few one = frequency [(1, pure 0), (4, pure 1), (10, choose (2, 3))] >>= \k -> vectorOf k one
    few1 one = choose (1, 3) >>= \k -> vectorOf k one
  signal n =
    frequency
      [ (5, sensor n)
      , (1, And <$> signal 0 <*> sensor n)
      , (1, hysteresis <*> sensor n)
      , (1, Debounce <$> choose (0, 3) <*> sensor n)
      , (1, Throttle <$> choose (0, 3) <*> sensor n)
      , (1, StaleAfter <$> choose (1, 3) <*> sensor n)
      ]
  hysteresis = do
    initially <- arbitrary
    (low, high) <- elements [(0, 2), (0, 2), (0, 1), (1, 1), (1, 2)]
    pure (Hysteresis initially low high)
  sensor n =
    frequency $
      [ (8, Watched <$> elements known)
      , (2, Polled <$> choose (1, 3) <*> (choose (0, min 1 n) >>= go))
      ]
        ++ [(6, pure Shared) | sharing]
        ++ [(2, signal 0)]
  -- A recovery that takes no time would repeat for ever while the condition holds.
  takingTime later = Then <$> (Do "a" . pure . (\s -> s {takes = max 1 (takes s)}) <$> script) <*> later

action :: Gen Program
action = Do "a" <$> (choose (1, 2) >>= \n -> vectorOf n script)

script :: Gen Script
script =
  Script
    <$> frequency [(1, pure 0), (6, choose (1, 4))]
    <*> frequency [(14, Succeeds <$> choose (0, 2)), (4, pure Fails), (1, pure Faults)]
    <*> frequency [(6, pure Unmasked), (1, pure Masked), (1, pure Uninterruptible)]
    <*> frequency
      [ (4, pure StopsAtOnce)
      , (2, StopsAfter <$> choose (0, 3))
      , (2, CleansUpInterruptibly <$> choose (0, 3))
      , (2, EndsAfter <$> choose (0, 2) <*> (Succeeds <$> choose (0, 2)))
      , (1, EndsAfter <$> choose (0, 2) <*> pure Fails)
      , (1, EndsAfter <$> choose (0, 2) <*> pure Faults)
      ]

-- | Gives every action a name of its own.
renamed :: Program -> Program
renamed p = fst (named p (map (('a' :) . show) [1 :: Int ..]))

named :: Program -> [Name] -> (Program, [Name])
named p names = case (p, names) of
  (Do _ scripts, name : others) -> (Do name scripts, others)
  _ -> let (parts', rest) = go (parts p) in (rebuild p parts', rest)
 where
  go = \case
    [] -> ([], names)
    qs -> foldl (\(done, ns) q -> let (q', ns') = named q ns in (done ++ [q'], ns')) ([], names) qs
