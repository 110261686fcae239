{-# OPTIONS_HADDOCK not-home #-}

-- |
-- How deep a text of JSON nests, and how long its numbers are: what is asked of a text before it is parsed.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Nesting
  ( nestsDeeperThan
  , hasMoreDigitsThan
  ) where

import qualified Data.ByteString.Lazy.Char8 as Bytes
import Data.Char (isDigit)

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

-- | Whether more digits than that follow each other anywhere outside of a text. To be asked before parsing: the work
-- for a number grows with the square of their number.
hasMoreDigitsThan :: Int -> Bytes.ByteString -> Bool
hasMoreDigitsThan limit content = Bytes.length content > fromIntegral limit && outside (0 :: Int) content
 where
  outside n rest
    | n > limit = True
    | otherwise = case Bytes.uncons rest of
        Nothing -> False
        Just ('"', more) -> within more
        Just (c, more) -> outside (if isDigit c then n + 1 else 0) more
  within rest = case Bytes.uncons (Bytes.dropWhile (\c -> c /= '"' && c /= '\\') rest) of
    Nothing -> False
    Just ('"', more) -> outside 0 more
    Just (_, more) -> within (Bytes.drop 1 more)
