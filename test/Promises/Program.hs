{-# LANGUAGE LambdaCase #-}

-- |
-- Random programs of "Language.Operator" for the promises. Each comes to an end.
module Promises.Program
  ( Program (..)
  , Part (..)
  , Sensing (..)
  , Change (..)
  , World
  , calm
  , blind
  , programsOf
  , Root (..)
  ) where

import Control.Exception (MaskingState (..))
import Data.Functor.Const (Const (..))
import Data.Maybe (isJust, isNothing)
import Test.QuickCheck (Gen, choose, elements, frequency, oneof, shuffle, suchThat, vectorOf)

import Language.Operator
import Promises.Stage

-- | A behaviour; the stimuli, each with the ticks before it; and the masking state of its caller.
data Program = Program Part [(Int, Stimulus Change)] MaskingState
  deriving (Show)

data Part
  = Leaf Act
  | -- | Makes the world 'calm'.
    Calm
  | Op (Operator Sensing Part)
  deriving (Show)

-- | What is watched, or polled with the given period in ticks: a level for each world from zero on.
data Sensing = Watched [Int] | Polled Int [Int] | Shared
  deriving (Show)

type World = Int

-- | In the first no signal holds; in the second all fail.
calm, blind :: World
calm = 4
blind = 5

data Change
  = Becomes World
  | -- | Delivers a message.
    Delivers
  | -- | From then on no part begins and no signal has a value: whatever waits or repeats then ends, though it has
    -- completed despite its only stop request.
    Over
  deriving (Show)

-- | Which operators may stand at the root.
data Root = AnyRoot | ReactiveRoot
  deriving (Eq)

programsOf :: Root -> Size -> Gen Program
programsOf root size = case size of
  Full -> Program <$> whole (const True) <*> stimuli <*> states
  -- Up to three threads: with a caller's thread one branch can run, without one two can.
  Tiny ->
    oneof
      [ Program <$> whole ((<= 1) . threads) <*> stimuli <*> states
      , Program <$> whole (\o -> threads o == 2 && not (waits o)) <*> pure [] <*> states
      ]
 where
  states = frequency [(4, pure Unmasked), (1, pure MaskedInterruptible), (1, pure MaskedUninterruptible)]
  stimuli = do
    changes <- choose someChanges >>= \n -> vectorOf n change
    cancels <-
      frequency [(if root == ReactiveRoot then 4 else 1, pure 0), (3, pure 1), (2, pure 2)] >>= \n ->
        vectorOf n (frequency [(2, pure CancelsCaller), (1, pure ThrowsAtCaller)])
    order <- shuffle (map Changes changes ++ cancels)
    (++ [(10, Changes Over)]) <$> traverse (\stimulus -> (\after -> (after, stimulus)) <$> choose (0, 2)) order
  change = frequency [(8, Becomes <$> choose (0, 3)), (2, pure (Becomes blind)), (2, pure Delivers)]
  someChanges = case size of
    Tiny -> (if root == ReactiveRoot then 1 else 0, 1)
    Full -> if root == ReactiveRoot then (1, 4) else (0, 3)

  whole wanted = do
    several <- if root == ReactiveRoot then pure False else frequency [(3, pure True), (2, pure False)]
    let rooted o = isJust (operatorName o) && atOnce o == several && not (null o)
    deep <- if size == Tiny then pure 1 else frequency [(1, pure 1), (2, pure 2)]
    numberedParts . Op . passingOn <$> (operator rooted outside deep `suchThat` wanted)
  operator wanted around n =
    calming <$> operators (\o -> wanted o && comesToAnEnd o) around sensing (\inner -> part inner (n - 1))
  part :: Around -> Int -> Gen Part
  part around n
    | n > 0 =
        frequency
          [ (3, part around 0)
          , (2, Op <$> operator (isNothing . operatorName) around n)
          , (3, Op <$> operator (isJust . operatorName) around n)
          ]
    | inScope around = oneof [leaf, Op <$> operators forks around sensing (const leaf)]
    | otherwise = leaf
  -- For the promise that no work is lost: what is often stopped, and responds in each way equally often.
  leaf
    | root == ReactiveRoot =
        (\act how -> Leaf act {takes = takes act + 1, stopResponse = how}) <$> acts 0 <*> elements [minBound ..]
    | otherwise = Leaf <$> acts 0
  sensing around =
    frequency $
      [(3, Watched <$> levels), (1, Polled <$> choose (1, 2) <*> levels)] ++ [(3, pure Shared) | sharing around]
  levels = vectorOf calm (choose (-1, 2))
  -- A recovery that did not remove its own cause would repeat for ever.
  calming = \case
    Monitor s recovery task -> Monitor s (Op (recovery `Then` Calm)) task
    o -> o

  -- A part in the caller's own thread could take the cancellation, which the test waits for: so it sees if it is lost.
  passingOn = \case
    Decide choice as _ -> Decide choice as Calm
    o -> o

-- | All operators, but 'Abandoning', whose part may outlive the program: it is the way out of the promises; and
-- no rules at all, which wait for ever.
comesToAnEnd :: Operator s p -> Bool
comesToAnEnd = \case
  Abandoning _ _ -> False
  TeleoReactive [] -> False
  _ -> True

-- | How many threads it has at a time, if its parts have none (but that of a scope forks one).
threads :: Operator Sensing Part -> Int
threads o = length [() | Polled _ _ <- signals] + case o of
  Timeout _ _ -> 2
  CleanupWithin _ _ -> 2
  Scoped _ -> 2
  MessageRule {} -> 2
  Decide _ as _ -> length as
  _ | isNothing (operatorName o) -> 0
    | atOnce o -> length o
    | otherwise -> min 1 (length o)
 where
  signals = getConst (traverseBoth (Const . pure) (const (Const [])) o)

-- | Whether it may wait for something else than its parts.
waits :: Operator s p -> Bool
waits = \case
  WaitUntil _ -> True
  TeleoReactive _ -> True
  MessageRule {} -> True
  _ -> False

-- | Gives every leaf a number of its own.
numberedParts :: Part -> Part
numberedParts = numbered . go
 where
  go = \case
    Leaf act -> Numbered (\n -> (n + 1, Leaf act {number = n}))
    Calm -> pure Calm
    Op o -> Op <$> traverse go o
