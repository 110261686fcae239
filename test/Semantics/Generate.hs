{-# OPTIONS_GHC -O1 #-}
-- |
-- Random worlds, and smaller ones.
--
-- Durations are few and small, so that ties are frequent.
module Semantics.Generate
  ( worlds
  , smallWorlds
  , shrinkWorld
  ) where

import Data.List (sortOn)
import Test.QuickCheck

import Language.Operator (Operator)
import Language.Random
import Semantics.Program hiding (Operator)
import qualified Semantics.Program as Program

-- | Worlds with programs up to the given depth, made of operators of the wanted kind.
worlds :: (Operator () () -> Bool) -> Int -> Gen World
worlds wanted deep = do
  first <- traverse (\c -> (,) c <$> frequency [(14, At <$> choose (0, 1)), (1, pure NoValue)]) known
  World first <$> someChanges <*> choose (4, 16) <*> someProgram wanted deep <*> callers <*> pure 0
 where
  someChanges = do
    n <- choose (0, 8)
    inOrder <$> vectorOf n (Change <$> choose (0, 8) <*> elements known <*> someLevel)
  someLevel = frequency [(30, At <$> choose (0, 2)), (1, pure NoValue), (1, pure ThrowsFailure), (1, pure ThrowsFault)]

-- | Worlds that are small enough to try all their schedules.
smallWorlds :: Gen World
smallWorlds = do
  first <- At <$> choose (0, 1)
  n <- choose (0, 2)
  later <- inOrder <$> vectorOf n (Change <$> choose (0, 2) <*> pure "p" <*> someLevel)
  let anything = someProgram (const True) 1
  World [("p", first), ("q", At 0)] later <$> choose (2, 4) <*> anything <*> callers <*> pure 0
 where
  someLevel = frequency [(4, At <$> choose (0, 1)), (1, pure NoValue)]

someProgram :: (Operator () () -> Bool) -> Int -> Gen Program
someProgram wanted deep = withNames <$> programs wanted deep

callers :: Gen Caller
callers =
  frequency
    [ (3, pure Program.Operator)
    , (1, PlainThread <$> elements [Asynchronous, Synchronous] <*> choose (0, 3))
    ]

inOrder :: [Change] -> [Change]
inOrder = sortOn (\(Change at _ _) -> at)

known :: [Condition]
known = ["p", "q"]

-- | Smaller worlds of the same kind.
shrinkWorld :: World -> [World]
shrinkWorld world =
  [world {program = p} | p <- shrinkProgram (program world)]
    ++ [world {changes = some} | some <- shrinkList shrinkChange (changes world)]
    ++ [world {caller = Program.Operator} | caller world /= Program.Operator]
    ++ [world {slippage = n} | n <- shrink (slippage world)]
    ++ [world {cancelAt = n} | n <- shrink (cancelAt world), n > 0]
 where
  shrinkChange (Change at condition level) =
    [Change at condition (At 0) | level `notElem` [At 0, At 1]] ++ [Change time condition level | time <- earlier at]
  earlier at = [at - 1 | at > 0, all (\(Change other _ _) -> other <= at - 1 || other >= at) (changes world)]
