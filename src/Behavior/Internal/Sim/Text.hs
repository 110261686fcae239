{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The text of what a user has written.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Text
  ( safeShow
  ) where

import Control.Exception (SomeException, evaluate, throwIO, try)
import System.IO.Unsafe (unsafePerformIO)

import Behavior.Internal.Failure (isCancellation)

-- | The text up to where to compute it throws, which is said then: what describes an
-- exception must not throw another.
safeShow :: String -> String
safeShow text = case unsafePerformIO (try (evaluate text) >>= either failing pure) of
  [] -> []
  c : rest -> case unsafePerformIO (try (evaluate c) >>= either (fmap Left . failing) (pure . Right)) of
    Left usualOtherwise -> usualOtherwise
    Right known -> known : safeShow rest
 where
  failing e
    | isCancellation e = throwIO (e :: SomeException)
    | otherwise = pure "<its text throws an exception>"
