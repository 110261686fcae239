{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Tables of text.
module Behavior.Trace.Table
  ( columns
  ) where

import Data.List (foldl')

-- | The lines of a table with its headings, given the cells of a row. The given number of columns are
-- numbers, and aligned to the right.
--
-- >>> mapM_ putStrLn (columns 1 ["runs", "path"] (\(runs, path) -> [show runs, path]) [(12, "mission")])
--   runs  path
--     12  mission
--
-- The cells are made twice, and not kept in between: so a long table takes little memory.
columns :: Int -> [String] -> (row -> [String]) -> [row] -> [String]
columns numbers headings cells rows = line headings : map (line . cells) rows
 where
  line = foldr (\cell after -> "  " ++ cell ++ after) "" . zipWith3 pad [0 ..] (map Just widths ++ [Nothing])
  -- (That of the last column is not needed.)
  widths = foldl' (\known -> strictly . zipWith max known . map length . cells) (map length (init headings)) rows
  strictly list = foldr seq list list
  pad :: Int -> Maybe Int -> String -> String
  pad i width text = case width of
    Nothing -> text
    Just w
      | i < numbers -> spaces w ++ text
      | otherwise -> text ++ spaces w
   where
    spaces w = replicate (w - length text) ' '
