{-# LANGUAGE LambdaCase #-}

-- |
-- Random programs and worlds.
--
-- Lengths of time are few and small, so that ties are frequent.
module Semantics.Generate
  ( worlds
  , smallWorlds
  , shrinkWorld
  , depth
  ) where

import Data.List (sortOn)
import Test.QuickCheck

import Semantics.Program

-- | Worlds with programs that nest up to so many operators deep.
worlds :: Int -> Gen World
worlds deep = do
  levels' <- traverse (\c -> (,) c <$> frequency [(14, At <$> choose (0, 1)), (1, pure Lost)]) known
  World levels' <$> someChanges <*> choose (4, 16) <*> (renamed <$> programs deep)
 where
  someChanges = do
    n <- choose (0, 8)
    inOrder <$> vectorOf n (Change <$> choose (0, 8) <*> elements known <*> someLevel)
  someLevel = frequency [(30, At <$> choose (0, 2)), (1, pure Lost), (1, pure Failing), (1, pure Faulting)]

-- | Worlds so small that all that can happen in them can be tried.
smallWorlds :: Gen World
smallWorlds = do
  first <- At <$> choose (0, 1)
  n <- choose (0, 2)
  changes' <- inOrder <$> vectorOf n (Change <$> choose (0, 2) <*> pure "p" <*> someLevel)
  World [("p", first), ("q", At 0)] changes' <$> choose (2, 4) <*> (renamed <$> programs 1)
 where
  someLevel = frequency [(4, At <$> choose (0, 1)), (1, pure Lost)]

inOrder :: [Change] -> [Change]
inOrder = sortOn (\(Change at _ _) -> at)

known :: [Condition]
known = ["p", "q"]

-- | Programs that nest up to so many operators deep, outside of any scope.
programs :: Int -> Gen Program
programs = within' False

within' :: Bool -> Int -> Gen Program
within' inScope = go
 where
  go :: Int -> Gen Program
  go 0 =
    frequency $
      [ (30, action)
      , (1, Pure . Number <$> choose (0, 2))
      , (1, WaitUntil <$> signal 0)
      ]
        ++ [(8, Fork <$> action) | inScope]
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
      , (4, RSelect <$> sensed <*> less <*> less)
      , (5, Monitor <$> sensed <*> takingTime less <*> less)
      , (2, Switch <$> sensed <*> few1 less)
      , (2, TeleoReactive <$> few ((,) <$> sensed <*> less))
      , (1, WaitUntil <$> sensed)
      , (2, WhileHolding <$> sensed <*> less)
      , (2, Timeout <$> frequency [(1, pure 0), (9, choose (1, 6))] <*> less)
      , (2, Scoped <$> within' True (n - 1))
      ]
        ++ [(3, Fork <$> less) | inScope]
   where
    less = frequency [(1, choose (0, n - 1)), (2, pure (n - 1))] >>= go
    sensed = signal (n - 1)
    few one = frequency [(1, pure 0), (4, pure 1), (10, choose (2, 3))] >>= \k -> vectorOf k one
    few1 one = choose (1, 3) >>= \k -> vectorOf k one
  signal n =
    frequency
      [ (4, Watched <$> elements known)
      , (1, Polled <$> choose (1, 3) <*> (choose (0, min 1 n) >>= go))
      ]
  -- One that takes no time, while the condition holds, would go on for ever.
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
      , (3, StopsAfter <$> choose (0, 3))
      , (2, EndsAfter <$> choose (0, 2) <*> (Succeeds <$> choose (0, 2)))
      , (1, EndsAfter <$> choose (0, 2) <*> pure Fails)
      , (1, EndsAfter <$> choose (0, 2) <*> pure Faults)
      ]

-- | Gives every action a name of its own.
renamed :: Program -> Program
renamed p = fst (named p (map (('a' :) . show) [1 :: Int ..]))

named :: Program -> [Name] -> (Program, [Name])
named p names = case p of
  Do _ scripts -> (Do (head names) scripts, tail names)
  _ -> let (parts', rest) = go (parts p) in (rebuild p parts', rest)
 where
  go = \case
    [] -> ([], names)
    qs -> foldl (\(done, ns) q -> let (q', ns') = named q ns in (done ++ [q'], ns')) ([], names) qs

-- | The programs of which a program is made, those of its signals first.
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
  RSelect s a b -> ofSignal s ++ [a, b]
  Monitor s a b -> ofSignal s ++ [a, b]
  Switch s as -> ofSignal s ++ as
  TeleoReactive rules -> concat [ofSignal s ++ [a] | (s, a) <- rules]
  WaitUntil s -> ofSignal s
  WhileHolding s a -> ofSignal s ++ [a]
  Timeout _ a -> [a]
  Scoped a -> [a]
  Fork a -> [a]

ofSignal :: Signal -> [Program]
ofSignal = \case
  Watched _ -> []
  Polled _ a -> [a]

-- | The program made of other parts, as many as it has.
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
  (RSelect s _ _, as) | (s', [a, b]) <- sensing s as -> RSelect s' a b
  (Monitor s _ _, as) | (s', [a, b]) <- sensing s as -> Monitor s' a b
  (Switch s _, as) | (s', bs) <- sensing s as -> Switch s' bs
  (TeleoReactive rules, as) -> TeleoReactive (ruled rules as)
  (WaitUntil s, as) -> WaitUntil (fst (sensing s as))
  (WhileHolding s _, as) | (s', [a]) <- sensing s as -> WhileHolding s' a
  (Timeout n _, [a]) -> Timeout n a
  (Scoped _, [a]) -> Scoped a
  (Fork _, [a]) -> Fork a
  _ -> p
 where
  sensing (Polled n _) (a : as) = (Polled n a, as)
  sensing s as = (s, as)
  ruled ((s, _) : rules) as | (s', a : as') <- sensing s as = (s', a) : ruled rules as'
  ruled _ _ = []

-- | How deep a program nests.
depth :: Program -> Int
depth p = maximum (0 : map ((+ 1) . depth) (parts p))

-- | Smaller worlds of the same kind.
shrinkWorld :: World -> [World]
shrinkWorld world =
  [world {program = p} | p <- shrinkProgram (program world), not (stray p)]
    ++ [world {changes = some} | some <- shrinkList shrinkChange (changes world)]
    ++ [world {patience = n} | n <- shrink (patience world), n > 0]
 where
  shrinkChange (Change at condition level) =
    [Change at condition (At 0) | level `notElem` [At 0, At 1]] ++ [Change at' condition level | at' <- earlier at]
  earlier at = [at - 1 | at > 0, all (\(Change other _ _) -> other <= at - 1 || other >= at) (changes world)]
  -- A fork outside of every scope is no program.
  stray = \case
    Fork _ -> True
    Scoped _ -> False
    p -> any stray (parts p)

shrinkProgram :: Program -> [Program]
shrinkProgram p = parts p ++ outer ++ inner
 where
  inner =
    [ rebuild p (take n ps ++ [q'] ++ drop (n + 1) ps)
    | let ps = parts p
    , (n, q) <- zip [0 ..] ps
    , q' <- shrinkPart q
    ]
  -- What keeps a recovery from going on for ever stays.
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
    TeleoReactive rules -> TeleoReactive <$> without rules
    Attempt n a -> [Attempt (n - 1) a | n > 1]
    RSelect (Polled _ _) a b -> [RSelect (Watched "p") a b]
    WhileHolding (Polled _ _) a -> [WhileHolding (Watched "p") a]
    _ -> []
  without xs = [take n xs ++ drop (n + 1) xs | n <- [0 .. length xs - 1]]
  simpler s =
    [s {masking = Unmasked} | masking s /= Unmasked]
      ++ [s {whenAsked = StopsAtOnce} | whenAsked s /= StopsAtOnce]
      ++ [s {ends = Succeeds 0} | ends s /= Succeeds 0]
      ++ [s {takes = takes s - 1} | takes s > 1]
