{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Lines of text for a window of a terminal: how many columns they take, and their colours.
module Behavior.Trace.Terminal.Screen
  ( -- * Lines
    Line
  , Paint (..)
  , plain
  , inAscii

    -- * Columns
  , columns
  , cutTo
  , cutLine

    -- * Frames
  , frame
  ) where

import Data.Char (GeneralCategory (..), generalCategory)
import System.Console.ANSI
  ( Color (..)
  , ColorIntensity (..)
  , ConsoleIntensity (..)
  , ConsoleLayer (..)
  , SGR (..)
  , clearFromCursorToLineEndCode
  , clearFromCursorToScreenEndCode
  , cursorUpLineCode
  , setSGRCode
  )

-- | A line: texts, each in a colour.
--
-- @since 0.1.0.0
type Line = [(Paint, String)]

-- | What a text is about; that decides its colour.
--
-- @since 0.1.0.0
data Paint = Normal | Muted | Strong | Good | Bad | Interrupted
  deriving (Eq, Show, Enum, Bounded)

-- | The line without colours.
--
-- @since 0.1.0.0
plain :: Line -> String
plain = concatMap snd

-- | The line with the sequences of characters that colour it.
--
-- @since 0.1.0.0
painted :: Line -> String
painted = concatMap one
 where
  one (Normal, t) = t
  one (p, t) = setSGRCode (codes p) ++ t ++ setSGRCode [Reset]
  codes p = case p of
    Normal -> []
    Muted -> [SetConsoleIntensity FaintIntensity]
    Strong -> [SetConsoleIntensity BoldIntensity]
    Good -> [SetColor Foreground Dull Green]
    Bad -> [SetColor Foreground Vivid Red]
    Interrupted -> [SetColor Foreground Vivid Magenta]

-- | The text for a terminal without Unicode.
inAscii :: String -> String
inAscii = map ascii
 where
  ascii c
    | c < '\x7F' = c
    | c == '…' = '~'
    | c == '→' = '>'
    | c == '●' = '*'
    | c == '✗' = 'x'
    | c == '■' = '#'
    | c == '·' = '-'
    | c == '◆' = '!'
    | otherwise = '?'

-- | How many columns the text takes. East Asian wide characters and emoji take two, combining
-- characters none.
--
-- >>> map columns ["door", "\x4E16\x754C", "e\x301"]
-- [4,4,1]
--
-- @since 0.1.0.0
columns :: String -> Int
columns = sum . map charColumns

charColumns :: Char -> Int
charColumns c
  | c < '\x300' = 1
  | generalCategory c `elem` [NonSpacingMark, EnclosingMark] = 0
  | any (\(a, b) -> c >= a && c <= b) wide = 2
  | otherwise = 1
 where
  wide =
    [ ('\x1100', '\x115F')
    , ('\x231A', '\x231B')
    , ('\x2329', '\x232A')
    , ('\x23E9', '\x23F3')
    , ('\x25FD', '\x25FE')
    , ('\x2614', '\x2615')
    , ('\x2630', '\x2637')
    , ('\x2648', '\x2653')
    , ('\x267F', '\x26FF')
    , ('\x2705', '\x2705')
    , ('\x270A', '\x270B')
    , ('\x2728', '\x2728')
    , ('\x274C', '\x2757')
    , ('\x2795', '\x27BF')
    , ('\x2B1B', '\x2B1C')
    , ('\x2B50', '\x2B55')
    , ('\x2E80', '\x303E')
    , ('\x3041', '\xA4CF')
    , ('\xA960', '\xA97C')
    , ('\xAC00', '\xD7A3')
    , ('\xF900', '\xFAFF')
    , ('\xFE10', '\xFE19')
    , ('\xFE30', '\xFE6F')
    , ('\xFF01', '\xFF60')
    , ('\xFFE0', '\xFFE6')
    , ('\x16FE0', '\x18DFF')
    , ('\x1AFF0', '\x1B2FF')
    , ('\x1D300', '\x1D376')
    , ('\x1F000', '\x1FAFF')
    , ('\x20000', '\x3FFFD')
    ]

-- | The text, cut off where it would take more columns than given.
--
-- >>> map (cutTo 4) ["door", "doors", "\x4E16\x754C\x4E16"]
-- ["door","doo\8230","\19990\8230"]
cutTo :: Int -> String -> String
cutTo n = plain . cutLine n . (: []) . (,) Normal

-- | The line, cut off where it would take more columns than given.
cutLine :: Int -> Line -> Line
cutLine n line
  | n <= 0 = []
  | columns (take (8 * n + 8) (plain line)) <= n && null (drop (8 * n + 8) (plain line)) = line
  | otherwise = go (n - 1) line
 where
  go _ [] = [(Muted, "…")]
  go left ((p, t) : rest) = case fill left t of
    (known, left', True) -> (p, known) : go left' rest
    (known, _, False) -> [(p, known ++ "…")]
  -- What fits of the text, how many columns are left, and whether that was all.
  fill left [] = ([], left, True)
  fill left (c : cs)
    | charColumns c <= left, (known, left', whole) <- fill (left - charColumns c) cs = (c : known, left', whole)
    | otherwise = ([], left, False)

-- | What is written to replace the frame before, of that number of lines, by these lines. The other
-- arguments say whether there are colours, and what the terminal's encoding makes of a text.
--
-- @since 0.1.0.0
frame :: Bool -> (String -> String) -> Int -> [Line] -> String
frame colours safe above tree = up ++ concatMap one tree ++ clearFromCursorToScreenEndCode
 where
  up = if above > 0 then cursorUpLineCode above else "\r"
  one line = text [(p, safe t) | (p, t) <- line] ++ clearFromCursorToLineEndCode ++ "\n"
  text = if colours then painted else plain
