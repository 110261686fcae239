-- |
-- Random programs that are small enough to explore all their schedules.
module Reality.Generate
  ( programs
  ) where

import Data.Maybe (isJust)
import Test.QuickCheck
import Test.QuickCheck.Gen (unGen)
import Test.QuickCheck.Random (mkQCGen)

import Language.Operator
import Language.Primitive

-- | The programs of a seed. (Two seeds have no program's seed in common, up to a million programs.)
programs :: Int -> [Program]
programs seed = [lettered (unGen (operator 1) (mkQCGen (seed * 1000003 + n)) 10) | n <- [0 ..]]

-- | An operator with threads of its own, which contains others up to the given depth.
operator :: Int -> Gen Program
operator n =
  frequency
    [ (4, Op <$> (Parallel <$> part <*> part))
    , (2, Op <$> (Both <$> part <*> part))
    , (4, Op . FirstOf <$> vectorOf 2 part)
    , (1, Op . AllOf <$> vectorOf 2 part)
    , (2, (\p q r -> Op (Scoped (Op (Await p q) `thenDo` r))) <$> part <*> step <*> step)
    , (3, meanwhile <$> changing <*> (Op <$> (RSelect 0 <$> part <*> part)))
    , (2, meanwhile <$> changing <*> (Op . Switch 0 <$> vectorOf 2 part))
    , (3, meanwhile <$> changing <*> (Op <$> (Monitor 0 . (`thenDo` Close 0) <$> step <*> part)))
    , (3, (\c p -> meanwhile c (Open 0 `thenDo` Op (WhileHolding 0 p))) <$> changing <*> part)
    , (3, thenDo (Open 0) . Op . WhileHolding 0 <$> closing)
    , (3, (\p q -> Open 0 `thenDo` Op (RSelect 0 p q)) <$> closing <*> step)
    , (2, (\p q -> Open 0 `thenDo` Op (Switch 0 [q, p])) <$> closing <*> step)
    , (2, Op <$> (Else <$> operator (n - 1) <*> step))
    , (2, wrapping (operator n))
    , (2, Op <$> operators untimed outside (const (choose (0, 1))) (const part))
    ]
 where
  part
    | n > 0 = frequency [(9, work), (1, operator (n - 1))]
    | otherwise = work
  meanwhile c p = Op (Parallel c p)
  -- Without durations, and without threads that go on.
  untimed o = isJust (operatorName o) && not (abandons o || receives o) && case o of
    Timeout _ _ -> False
    CleanupWithin _ _ -> False
    _ -> True
  -- A branch that makes its own condition false.
  closing =
    oneof
      [ thenDo (Close 0) <$> work
      , wrapping (pure (Close 0))
      , thenDo <$> wrapping (pure (Close 0)) <*> step
      , wrapping (thenDo (Close 0) <$> step)
      ]
  -- Changes the condition; most of these then wait, so that the other branch ends first.
  changing =
    frequency [(3, pure (Open 0 `thenDo` Pass 1)), (1, pure (Open 0 `thenDo` (Close 0 `thenDo` Pass 1))), (1, step)]

-- | What a branch does.
work :: Gen Program
work =
  frequency
    [ (4, step)
    , (3, thenDo <$> step <*> step)
    , (3, wrapping step)
    , (2, wrapping (thenDo <$> step <*> step))
    , (1, (\p q -> Op (Else p q)) <$> step <*> step)
    ]

wrapping :: Gen Program -> Gen Program
wrapping p =
  frequency
    [ (2, Masked <$> p)
    , (1, (\q -> Masked (thenDo q Allow)) <$> p)
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
    , (2, Pass <$> choose (0, 1))
    , (1, pure (Fails 'x'))
    , (1, pure (Faults 'x'))
    ]

thenDo :: Program -> Program -> Program
thenDo p q = Op (Then p q)
