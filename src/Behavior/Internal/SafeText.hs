{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Texts that the user's code computes.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.SafeText
  ( safeShow
  , settledText
  ) where

import Control.Exception (SomeException, catch, evaluate, throwIO, try)
import System.IO.Unsafe (unsafePerformIO)

import Behavior.Internal.Failure (isCancellation)

-- | The text up to the place where computing it throws, and then a remark that it throws: the
-- description of an exception must not throw another one.
safeShow :: String -> String
safeShow text = case unsafePerformIO (try (evaluate text) >>= either failing pure) of
  [] -> []
  c : rest -> case unsafePerformIO (try (evaluate c) >>= either (fmap Left . failing) (pure . Right)) of
    Left remark -> remark
    Right known -> known : safeShow rest
 where
  failing e
    | isCancellation e = throwIO (e :: SomeException)
    | otherwise = pure "<its text throws an exception>"

-- | The text, wholly evaluated, and cut if it is long: whatever the user's code does, it can be compared and
-- written. What computing it throws is named, as by 'safeShow'.
settledText :: String -> String
settledText text = unsafePerformIO (whole text `catch` \(_ :: SomeException) -> whole (safeShow text))
 where
  whole t = let cut = limited t in evaluate (foldr seq cut cut)
  limited t = case splitAt textLimit t of
    (_, []) -> t
    (beginning, _) -> beginning ++ " ..."

-- | Longer texts are cut.
textLimit :: Int
textLimit = 10000
