{-# LANGUAGE LambdaCase #-}

-- |
-- Random behaviours, in which every operator can be nested in every other.
module Promises.Tree
  ( Program (..)
  , Tree (..)
  , Sensing (..)
  , programsOf
  , Root (..)
  ) where

import Control.Exception (MaskingState (..))
import Test.QuickCheck (Gen, choose, elements, frequency, oneof, shuffle, vectorOf)

import Promises.Stage

-- | A behaviour; the stimuli, each with the ticks before it (the world is a number, which
-- the conditions read); and the masking state of its caller.
data Program = Program Tree [(Int, Stimulus Int)] MaskingState
  deriving (Show)

data Tree
  = Leaf Act
  | Fallback Tree Tree
  | Attempt Int Tree
  | Parallel Tree Tree
  | Both Tree Tree
  | FirstOf [Tree]
  | AllOf [Tree]
  | -- | When that many have succeeded, the results; or fails.
    Decide Int [Tree]
  | Beside [Tree] Tree
  | Select Sensing Tree Tree
  | Monitor Sensing Tree Tree
  | WhileHolding Sensing Tree
  | Timeout Int Tree
  deriving (Show)

-- | Whether a condition is watched, or polled with the given period in ticks.
data Sensing = Watched | Polled Int
  deriving (Show)

-- | Which operators may stand at the root.
data Root = AnyRoot | ReactiveRoot
  deriving (Eq)

programsOf :: Root -> Size -> Gen Program
programsOf root size = case size of
  Full -> Program <$> (numbered <$> tree 2) <*> stimuli <*> states
  -- Up to three threads: with a caller's thread one branch can run, without one two can.
  Tiny ->
    oneof
      [ Program <$> (numbered <$> tree' narrow 1) <*> stimuli <*> states
      , Program <$> (numbered <$> tree' wide 1) <*> pure [] <*> states
      ]
 where
  states = frequency [(4, pure Unmasked), (1, pure MaskedInterruptible), (1, pure MaskedUninterruptible)]
  stimuli = do
    changes <- choose someChanges >>= \n -> vectorOf n (Changes <$> choose (0, 3))
    cancels <-
      frequency [(1, pure 0), (3, pure 1), (2, pure 2)] >>= \n ->
        vectorOf n (frequency [(2, pure CancelsCaller), (1, pure ThrowsAtCaller)])
    order <- shuffle (changes ++ cancels)
    traverse (\stimulus -> (\after -> (after, stimulus)) <$> choose (0, 2)) order

  someChanges = case size of
    Tiny -> (0, 1)
    Full -> if root == ReactiveRoot then (1, 4) else (0, 3)

  tree :: Int -> Gen Tree
  tree n = oneof (reactive n ++ (if root == ReactiveRoot then [] else concurrent n))
  tree' kinds n = oneof (kinds n)
  -- For the promise that no work is lost, the stop responses are equally frequent.
  leaf
    | root == ReactiveRoot = (\act how -> Leaf act {stopResponse = how}) <$> acts 0 <*> elements [minBound ..]
    | otherwise = Leaf <$> acts 0
  within' :: Int -> Gen Tree
  within' 0 = leaf
  within' n =
    frequency
      [ (3, leaf)
      , (1, Fallback <$> within' (n - 1) <*> within' (n - 1))
      , (1, Attempt <$> choose (1, 3) <*> within' (n - 1))
      , (3, oneof (reactive n ++ concurrent n))
      ]
  less n = within' (n - 1)
  sensings = if size == Tiny then pure Watched else frequency [(3, pure Watched), (1, Polled <$> choose (1, 2))]
  reactive n =
    [ Select <$> sensings <*> less n <*> less n
    , Monitor <$> sensings <*> less n <*> less n
    , WhileHolding <$> sensings <*> less n
    ]
      ++ [Timeout <$> choose (0, 3) <*> less n | size == Full]
  concurrent n =
    [ Parallel <$> less n <*> less n
    , Both <$> less n <*> less n
    , FirstOf <$> several (less n)
    , AllOf <$> several (less n)
    , Decide <$> choose (1, 2) <*> several (less n)
    , Beside <$> (choose (1, 2) >>= \k -> vectorOf k (less n)) <*> less n
    ]
  several g = choose (1, 3) >>= \k -> vectorOf k g
  narrow n
    | root == ReactiveRoot = reactive n
    | otherwise = reactive n ++ [FirstOf . pure <$> less n, AllOf . pure <$> less n]
  wide n
    | root == ReactiveRoot = [Timeout <$> choose (0, 3) <*> less n, Monitor (Polled 1) <$> less n <*> less n]
    | otherwise =
        [ Timeout <$> choose (0, 3) <*> less n
        , Parallel <$> less n <*> less n
        , Both <$> less n <*> less n
        , FirstOf <$> vectorOf 2 (less n)
        , AllOf <$> vectorOf 2 (less n)
        , Decide <$> choose (1, 2) <*> vectorOf 2 (less n)
        , Beside <$> vectorOf 1 (less n) <*> less n
        ]

-- | Gives every leaf a number of its own.
numbered :: Tree -> Tree
numbered = snd . go 1
 where
  go :: Int -> Tree -> (Int, Tree)
  go n = \case
    Leaf act -> (n + 1, Leaf act {number = n})
    Fallback a b -> two Fallback n a b
    Attempt k a -> Attempt k <$> go n a
    Parallel a b -> two Parallel n a b
    Both a b -> two Both n a b
    FirstOf as -> FirstOf <$> all' n as
    AllOf as -> AllOf <$> all' n as
    Decide m as -> Decide m <$> all' n as
    Beside as b -> let (m, as') = all' n as in Beside as' <$> go m b
    Select l a b -> two (Select l) n a b
    Monitor l a b -> two (Monitor l) n a b
    WhileHolding l a -> WhileHolding l <$> go n a
    Timeout k a -> Timeout k <$> go n a
  two f n a b = let (m, a') = go n a in f a' <$> go m b
  all' n [] = (n, [])
  all' n (a : as) = let (m, a') = go n a in (a' :) <$> all' m as
