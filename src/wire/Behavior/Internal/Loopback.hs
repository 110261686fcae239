{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The names by which a machine reaches itself: what is sent there, no other machine reads.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Loopback
  ( isLoopback
  ) where

import Data.Char (isDigit, toLower)

-- | Whether the name is one of this machine for itself. (An address of IPv6 may be in brackets.)
--
-- >>> map isLoopback ["localhost", "127.0.0.1", "::1", "0.0.0.0", "127.0.0.1.example.org", "robot.local"]
-- [True,True,True,False,False,False]
isLoopback :: String -> Bool
isLoopback name = map toLower name `elem` ["localhost", "::1", "[::1]"] || isAddress (parts name)
 where
  isAddress these = take 1 these == ["127"] && length these == 4 && all isByte these
  isByte digits = not (null digits) && length digits <= 3 && all isDigit digits && (read digits :: Int) < 256
  parts text = case break (== '.') text of
    (part, _ : others) -> part : parts others
    (part, []) -> [part]
