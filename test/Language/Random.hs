{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Random programs of "Language.Script", and smaller ones.
module Language.Random
  ( programs
  , shrinkProgram
  , withNames
  , isWellFormed
  ) where

import Test.QuickCheck (Gen, arbitrary, choose, elements, frequency, shrinkList, vectorOf)

import Language.Operator (Around (..), Numbered (..), Smaller (..))
import qualified Language.Operator as O
import Language.Script

-- | Programs up to the given depth, made of operators of the wanted kind.
programs :: (O.Operator () () -> Bool) -> Int -> Gen Program
programs wanted = go O.outside
 where
  go :: Around -> Int -> Gen Program
  go around 0 =
    frequency $
      [(30, action), (1, Pure . Number <$> choose (0, 2)), (1, Sleep <$> choose (0, 3))]
        ++ [(3, pure Deliver) | wanted (O.HandleNext ())]
        ++ [(1, WaitUntil <$> signal around 0) | wanted (O.WaitUntil ())]
        ++ [(14, Op <$> O.operators O.forks around (const (pure Shared)) (const action)) | inScope around]
  go around n =
    frequency [(1, go around 0), (42, O.operators wanted around (`signal` (n - 1)) less >>= fmap Op . inTime)]
   where
    less inside = frequency [(1, choose (0, n - 1)), (2, pure (n - 1))] >>= go inside
  -- A recovery that takes no time would repeat for ever while the condition holds; so would a handler that delivers.
  inTime = \case
    O.Monitor s recovery task -> (\a -> O.Monitor s (takingTime a `Then` recovery) task) <$> script
    O.OnMessage handler task -> (\a -> O.OnMessage (takingTime a `Then` handler) task) <$> script
    O.MessageRule r p handler s q -> (\a -> O.MessageRule r p (takingTime a `Then` handler) s q) <$> script
    o -> pure o
  takingTime s = Do "a" [s {takes = max 1 (takes s)}]
  signal around n =
    frequency
      [ (5, sensor around n)
      , (1, And <$> signal around 0 <*> sensor around n)
      , (1, hysteresis <*> sensor around n)
      , (1, Debounce <$> choose (0, 3) <*> sensor around n)
      , (1, Throttle <$> choose (0, 3) <*> sensor around n)
      , (1, StaleAfter <$> choose (1, 3) <*> sensor around n)
      ]
  hysteresis = do
    initially <- arbitrary
    (low, high) <- elements [(0, 2), (0, 2), (0, 1), (1, 1), (1, 2)]
    pure (Hysteresis initially low high)
  sensor around n =
    frequency $
      [ (8, Watched <$> elements ["p", "q"])
      , (2, Polled <$> choose (1, 3) <*> (choose (0, min 1 n) >>= go around))
      ]
        ++ [(6, pure Shared) | sharing around]
        ++ [(2, signal around 0)]

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

-- * Smaller programs

-- | Its parts, and the programs with a smaller part.
shrinkProgram :: Program -> [Program]
shrinkProgram p = filter isWellFormed (parts p ++ smaller p)
 where
  smaller = \case
    Do name scripts -> [Do name some | some <- shrinkList shrinkScript scripts, not (null some)]
    Pure Unit -> []
    Deliver -> [Pure Unit]
    Sleep n -> Pure Unit : [Sleep (n - 1) | n > 0]
    Pure _ -> [Pure Unit]
    Op o -> Op <$> O.shrinkOperator shrinkSignal (\q -> parts q ++ smaller q) o
  shrinkSignal s = case s of
    Watched _ -> []
    Shared -> [Watched "p"]
    Polled n a -> Watched "p" : [Polled (n - 1) a | n > 1] ++ inner s
    And a b -> a : b : [And a' b | a' <- shrinkSignal a] ++ [And a b' | b' <- shrinkSignal b]
    Hysteresis initially low high a -> a : (Hysteresis initially low high <$> shrinkSignal a)
    Debounce n a -> a : (Debounce n <$> shrinkSignal a)
    Throttle n a -> a : (Throttle n <$> shrinkSignal a)
    StaleAfter n a -> a : (StaleAfter n <$> shrinkSignal a)
  inner s = let Smaller _ others = traverse (O.smaller (\q -> parts q ++ smaller q)) s in others

shrinkScript :: Script -> [Script]
shrinkScript s =
  [s {masking = Unmasked} | masking s /= Unmasked]
    ++ [s {onStop = StopsAtOnce} | onStop s /= StopsAtOnce]
    ++ [s {ends = Succeeds 0} | ends s /= Succeeds 0]
    ++ [s {takes = takes s - 1} | takes s > 1]

-- * What their actions and forks need

-- | Gives every action a name of its own.
withNames :: Program -> Program
withNames = O.numbered . go
 where
  go = \case
    Do _ scripts -> Numbered (\n -> (n + 1, Do ('a' : show n) scripts))
    Op o -> Op <$> O.traverseBoth (traverse go) go o
    p -> pure p

-- | Whether each fork is in a scope, and each shared signal where there is one; and whether each recovery and
-- each handler takes time: otherwise it might repeat for ever.
isWellFormed :: Program -> Bool
isWellFormed = go O.outside
 where
  go around = \case
    Op o ->
      (inScope around || not (O.forks o))
        && all (\s -> sharing around || not (usesShared s)) (signals (Op o))
        && all (all (go around)) (signals (Op o))
        && all (go (O.aroundPartsOf o around)) o
        && takesTime o
    _ -> True
  takesTime = \case
    O.Monitor _ recovery _ -> beginsLong recovery
    O.OnMessage handler _ -> beginsLong handler
    O.MessageRule _ _ handler _ _ -> beginsLong handler
    _ -> True
  beginsLong = \case
    Do _ scripts -> all ((> 0) . takes) scripts
    Then a _ -> beginsLong a
    _ -> False
