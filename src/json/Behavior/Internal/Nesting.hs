{-# OPTIONS_HADDOCK not-home #-}

-- |
-- How deep a text of JSON nests: what is asked of a text from outside before it is parsed.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Nesting
  ( nestsDeeperThan
  ) where

import qualified Data.ByteString.Lazy.Char8 as Bytes

-- | Whether brackets nest deeper than that anywhere. To be asked before parsing: a parser needs a few hundred
-- bytes of memory for each bracket.
nestsDeeperThan :: Int -> Bytes.ByteString -> Bool
nestsDeeperThan limit content =
  Bytes.count '[' content + Bytes.count '{' content > fromIntegral limit
    && deepest (Bytes.foldl' next (Outside 0 0) content) > limit
 where
  next state c = case state of
    Outside d m
      | c == '[' || c == '{' -> Outside (d + 1) (max m (d + 1))
      | c == ']' || c == '}' -> Outside (d - 1) m
      | c == '"' -> Within d m
      | otherwise -> state
    Within d m
      | c == '"' -> Outside d m
      | c == '\\' -> Escaped d m
      | otherwise -> state
    Escaped d m -> Within d m
  deepest state = case state of
    Outside _ m -> m
    Within _ m -> m
    Escaped _ m -> m

-- How deep it is there, and at the deepest place before: outside of a text, within one, or after its backslash.
data Nesting = Outside !Int !Int | Within !Int !Int | Escaped !Int !Int
