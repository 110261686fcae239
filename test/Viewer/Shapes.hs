-- |
-- The points of an SVG file's paths.
module Viewer.Shapes
  ( numbers
  , outline
  ) where

import Data.Bifunctor (first)
import Data.Char (isDigit, isSpace)

-- | The numbers of a path.
numbers :: String -> [Double]
numbers text = maybe [] (\(n, rest) -> n : numbers rest) (nextNumber text)

nextNumber :: String -> Maybe (Double, String)
nextNumber text = case dropWhile (\c -> not (isDigit c || c == '-')) text of
  [] -> Nothing
  '-' : rest -> first negate <$> nextNumber rest
  rest
    | (digits, after) <- span (\c -> isDigit c || c == '.') rest ->
        Just (read (if '.' `elem` digits then digits else digits ++ ".0"), after)

-- | The points of an outline: where they are from left to right, and from top to bottom.
outline :: String -> ([Double], [Double])
outline = go (0, 0)
 where
  go (x, y) d = case dropWhile isSpace d of
    'M' : rest | ([a, b], rest') <- arguments 2 rest -> at (a, b) rest'
    'H' : rest | ([a], rest') <- arguments 1 rest -> at (a, y) rest'
    'V' : rest | ([b], rest') <- arguments 1 rest -> at (x, b) rest'
    'h' : rest | ([a], rest') <- arguments 1 rest -> at (x + a, y) rest'
    'v' : rest | ([b], rest') <- arguments 1 rest -> at (x, y + b) rest'
    'l' : rest | ([a, b], rest') <- arguments 2 rest -> at (x + a, y + b) rest'
    'm' : rest | ([a, b], rest') <- arguments 2 rest -> at (x + a, y + b) rest'
    'L' : rest | ([a, b], rest') <- arguments 2 rest -> at (a, b) rest'
    'C' : rest | ([_, _, _, _, a, b], rest') <- arguments 6 rest -> at (a, b) rest'
    'q' : rest | ([_, _, a, b], rest') <- arguments 4 rest -> at (x + a, y + b) rest'
    'Z' : rest -> go (x, y) rest
    _ -> ([], [])
   where
    at (a, b) rest = let (xs, ys) = go (a, b) rest in (a : xs, b : ys)
  arguments :: Int -> String -> ([Double], String)
  arguments 0 rest = ([], rest)
  arguments n rest = case nextNumber rest of
    Just (v, after) | (vs, after') <- arguments (n - 1) after -> (v : vs, after')
    Nothing -> ([], rest)
