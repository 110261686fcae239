{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Texts that the user's code computes.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.SafeText
  ( safeShow
  ) where

import Control.Exception (SomeException, evaluate, throwIO, try)
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
