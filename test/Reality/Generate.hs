{-# LANGUAGE LambdaCase #-}

-- |
-- Random programs that are small enough to explore all their schedules.
module Reality.Generate
  ( programs
  ) where

import Data.List (mapAccumL)
import Test.QuickCheck
import Test.QuickCheck.Gen (unGen)
import Test.QuickCheck.Random (mkQCGen)

import Reality.Program

-- | The programs of a seed. (Two seeds have no program's seed in common, up to a million programs.)
programs :: Int -> [Program]
programs seed = [lettered (unGen (operator 1) (mkQCGen (seed * 1000003 + n)) 10) | n <- [0 ..]]

-- | An operator with threads of its own, which contains others up to the given depth.
operator :: Int -> Gen Program
operator n =
  frequency
    [ (4, Parallel <$> part <*> part)
    , (2, Both <$> part <*> part)
    , (4, FirstOf <$> vectorOf 2 part)
    , (1, AllOf <$> vectorOf 2 part)
    , (2, Forking <$> part <*> step <*> step)
    , (3, meanwhile <$> changing <*> (RSelect 0 <$> part <*> part))
    , (2, meanwhile <$> changing <*> (Switch 0 <$> part <*> part))
    , (3, meanwhile <$> changing <*> (Monitor 0 . (`Then` Close 0) <$> step <*> part))
    , (3, (\c p -> meanwhile c (Open 0 `Then` WhileHolding 0 p)) <$> changing <*> part)
    , (3, Then (Open 0) . WhileHolding 0 <$> closing)
    , (3, (\p q -> Open 0 `Then` RSelect 0 p q) <$> closing <*> step)
    , (2, (\p q -> Open 0 `Then` Switch 0 p q) <$> closing <*> step)
    , (2, Else <$> operator (n - 1) <*> step)
    , (2, wrapping (operator n))
    ]
 where
  part
    | n > 0 = frequency [(9, work), (1, operator (n - 1))]
    | otherwise = work
  meanwhile = Parallel
  -- A branch that makes its own condition false.
  closing =
    oneof
      [ Then (Close 0) <$> work
      , wrapping (pure (Close 0))
      , Then <$> wrapping (pure (Close 0)) <*> step
      , wrapping (Then (Close 0) <$> step)
      ]
  -- Changes the condition; most of these then wait, so that the other branch ends first.
  changing =
    frequency [(3, pure (Open 0 `Then` Await 1)), (1, pure (Open 0 `Then` (Close 0 `Then` Await 1))), (1, step)]

-- | What a branch does.
work :: Gen Program
work =
  frequency
    [ (4, step)
    , (3, Then <$> step <*> step)
    , (3, wrapping step)
    , (2, wrapping (Then <$> step <*> step))
    , (1, Else <$> step <*> step)
    ]

wrapping :: Gen Program -> Gen Program
wrapping p =
  frequency
    [ (2, Masked <$> p)
    , (1, (\q -> Masked (Then q Allow)) <$> p)
    , (3, Uninterruptible <$> p)
    , (2, Finally <$> p <*> step)
    , (1, OnException <$> p <*> step)
    , (3, OnException <$> (Uninterruptible <$> p) <*> pure (Note 'x'))
    ]

step :: Gen Program
step =
  frequency
    [ (8, pure (Note 'x'))
    , (2, Open <$> choose (0, 1))
    , (1, Close <$> choose (0, 1))
    , (2, Await <$> choose (0, 1))
    , (1, pure (Fails 'x'))
    , (1, pure (Faults 'x'))
    ]

-- | Gives every part its own letter.
lettered :: Program -> Program
lettered = snd . go ['a' ..]
 where
  go letters = \case
    Note _ -> letter letters Note
    Fails _ -> letter letters Fails
    Faults _ -> letter letters Faults
    Then p q -> two letters Then p q
    Else p q -> two letters Else p q
    Masked p -> Masked <$> go letters p
    Uninterruptible p -> Uninterruptible <$> go letters p
    Finally p q -> two letters Finally p q
    OnException p q -> two letters OnException p q
    Parallel p q -> two letters Parallel p q
    Both p q -> two letters Both p q
    FirstOf ps -> FirstOf <$> mapAccumL go letters ps
    AllOf ps -> AllOf <$> mapAccumL go letters ps
    Forking p q r ->
      let (letters', p') = go letters p
       in (\(rest, q', r') -> (rest, Forking p' q' r')) (pair letters' q r)
    RSelect g p q -> two letters (RSelect g) p q
    Switch g p q -> two letters (Switch g) p q
    Monitor g p q -> two letters (Monitor g) p q
    WhileHolding g p -> WhileHolding g <$> go letters p
    other -> (letters, other)
  letter (c : rest) make = (rest, make c)
  letter [] make = ([], make '?')
  two letters make p q = (\(rest, p', q') -> (rest, make p' q')) (pair letters p q)
  pair letters p q =
    let (letters', p') = go letters p
        (rest, q') = go letters' q
     in (rest, p', q')
