{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE BangPatterns #-}
{-# LANGUAGE MagicHash #-}

-- |
-- The states of a specification are large, and share most of what they consist of with those that came before.
module Language.Same
  ( unlessSame
  ) where

import GHC.Exts (isTrue#, reallyUnsafePtrEquality#)

-- | The comparison; what is the same in memory is equal, without a look into it.
unlessSame :: (a -> a -> Ordering) -> a -> a -> Ordering
unlessSame comparison !a !b
  | isTrue# (reallyUnsafePtrEquality# a b) = EQ
  | otherwise = comparison a b
{-# INLINE unlessSame #-}
