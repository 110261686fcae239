{-# LANGUAGE OverloadedStrings #-}

-- |
-- The elements of a timeline: shapes, texts and colours.
module Behavior.Trace.Svg.Draw
  ( -- * Elements
    document
  , shape
  , textAt
  , path
  , group
  , titled
  , Part

    -- * Shapes
  , barShape
  , markShape
  , outcomeClass

    -- * Texts
  , some
  , textWidth
  , partsWidth
  , fitted

    -- * Numbers
  , px
  ) where

import Data.Char (isUpper, ord)
import Data.Text (Text)
import qualified Data.Text as Text
import qualified Data.Text.Lazy as Lazy
import qualified Data.Text.Lazy.Builder as Builder
import Graphics.Svg.Core
import Numeric (showFFloat, showHex)

import Behavior.Trace.Describe (inert)
import Behavior.Trace.Svg.Outcome
import Behavior.Trace.Svg.Style

-- | A class and a text in it.
type Part = (Text, String)

-- | The file: its width and height, its label for screen readers, and what is drawn. It
-- contains ASCII characters only, so that it is right in every encoding.
document :: Double -> Double -> String -> [Element] -> Lazy.Text
document width height label inner = ascii (renderText (makeElement "svg" content `with` attributes))
 where
  attributes =
    [ makeAttribute "xmlns" "http://www.w3.org/2000/svg"
    , makeAttribute "class" "bt"
    , makeAttribute "role" "img"
    , makeAttribute "aria-label" (Text.pack (inert label))
    , makeAttribute "width" (px width)
    , makeAttribute "height" (px height)
    , makeAttribute "viewBox" (Text.unwords ["0 0", px width, px height])
    ]
  content = makeElement "style" (toElement style) <> makeElement "defs" patterns <> mconcat inner
  ascii = Builder.toLazyText . Lazy.foldr ((<>) . reference) mempty
  reference c
    | c < '\x7F' = Builder.singleton c
    | otherwise = Builder.fromString ("&#x" ++ showHex (ord c) ";")

-- | A path of that class.
shape :: Text -> Text -> Element
shape classes d = path classes d mempty

-- | A path of that class, with something in it.
path :: Text -> Text -> Element -> Element
path classes d inner =
  makeElement "path" inner `with` (inClass classes ++ [makeAttribute "d" d])

-- | These elements, of that class.
group :: Text -> [Element] -> Element
group classes inner = makeElement "g" (mconcat inner) `with` inClass classes

-- (svg-builder writes an attribute without a text as XML does not allow it.)
inClass :: Text -> [Attribute]
inClass classes = [makeAttribute "class" classes | not (Text.null classes)]

-- | What is shown when the pointer is on the element.
titled :: [String] -> Element
titled texts = makeElement "title" (toElement (Text.intercalate "\n" (map (Text.pack . inert) texts)))

-- | A text of several parts, with a space between them.
textAt :: Text -> Double -> Double -> [Part] -> Element
textAt classes x y parts =
  makeElement "text" (mconcat (zipWith part (False : repeat True) parts))
    `with` (inClass classes ++ [makeAttribute "x" (px x), makeAttribute "y" (px y)])
 where
  part False ("", t) = toElement (Text.pack (inert t))
  part spaced (c, t) =
    makeElement "tspan" (toElement (Text.pack (inert t)))
      `with` (inClass c ++ [makeAttribute "dx" (px partSpace) | spaced])

-- | How wide these parts are at most, with the space between them.
partsWidth :: [Part] -> Double
partsWidth parts = sum (map wide parts) + partSpace * fromIntegral (max 0 (length parts - 1))
 where
  wide (c, t) = (if c == "k" then 1.12 else 1) * textWidth t

partSpace :: Double
partSpace = 7

-- | The class of the shapes with this outcome.
outcomeClass :: SpanOutcome -> Text
outcomeClass o = case o of
  Success -> "s"
  RanAgain -> "a"
  CutShort -> "s"
  Failure -> "f"
  Fault -> "x"
  Stop -> "p"
  Running -> "r"

-- | The outline of a bar. The right end is round if it succeeded, notched if it failed, jagged if
-- it faulted, cut off if it was stopped or a signal ended it, and open if it was still running.
barShape :: SpanOutcome -> Double -> Double -> Double -> Double -> Text
barShape outcome x y w h = Text.concat $ case outcome of
  RanAgain -> rounded
  Success -> rounded
  Failure -> corner ++ line (-n) (h / 2) ++ line n (h / 2) ++ back
  Fault -> corner ++ concat (replicate 2 (line (-n) (h / 4) ++ line n (h / 4))) ++ back
  Stop -> cutOff
  CutShort -> cutOff
  Running -> ["M", px (x + w), " ", px y, "H", px x, "V", px (y + h), "H", px (x + w)]
 where
  rounded =
    ["M", px (x + r), " ", px y, "H", px (x + w - r), "q", px r, " 0 ", px r, " ", px r]
      ++ ["V", px (y + h - r), "q0 ", px r, " ", px (-r), " ", px r]
      ++ ["H", px (x + r), "q", px (-r), " 0 ", px (-r), " ", px (-r)]
      ++ ["V", px (y + r), "q0 ", px (-r), " ", px r, " ", px (-r), "Z"]
  cutOff = corner ++ line (-n) h ++ back
  r = min 3 (w / 2)
  n = min 8 (w / 2)
  corner = ["M", px x, " ", px y, "H", px (x + w)]
  line dx dy = ["l", px dx, " ", px dy]
  back = ["H", px x, "Z"]

-- | The outline of a mark that is too narrow for a bar. It is taller if it failed (upwards), if it was
-- stopped (downwards), or faulted (both).
markShape :: SpanOutcome -> Double -> Double -> Double -> Double -> Text
markShape outcome x y w h =
  Text.concat ["M", px x, " ", px (y - up), "h", px w, "v", px (h + up + down), "h", px (-w), "Z"]
 where
  up = if outcome `elem` [Failure, Fault] then 3 else 0
  down = if outcome `elem` [Stop, Fault] then 3 else 0

-- | That number of things. The name of the thing is in the singular.
some :: Int -> String -> String
some n thing = show n ++ " " ++ thing ++ (if n == 1 then "" else "s")

-- | How wide the text is at most, at 12 pixels a line. (There are wider fonts than this
-- estimate assumes, but few.)
textWidth :: String -> Double
textWidth = sum . map charWidth
 where
  charWidth c
    | c `elem` ("iIjl.,:;'|! " :: String) = 4.2
    | c `elem` ("frt()[]-\"/" :: String) = 5.2
    | c `elem` ("mwMW@%" :: String) = 11.5
    | isUpper c = 8.6
    | c < '\x300' || c == '…' || c == '→' = 7.5
    | c < '\x1100' = 9
    | otherwise = 13

-- | The text, cut off where it would be wider.
fitted :: Double -> String -> String
fitted width text
  | textWidth (take 400 text) <= width = text
  | otherwise = go (width - textWidth "…") text
 where
  go left (c : rest) | w <- textWidth [c], w <= left = c : go (left - w) rest
  go _ _ = "…"

-- | Pixels, with one digit after the point if it is needed.
px :: Double -> Text
px v
  | isNaN v || isInfinite v = "0"
  | otherwise = Text.pack $ case showFFloat (Just 1) v "" of
      "-0.0" -> "0"
      digits | ".0" <- drop (length digits - 2) digits -> take (length digits - 2) digits
      digits -> digits

patterns :: Element
patterns =
  hatch "bt-f" 7 "fh" [diagonal 7]
    <> hatch "bt-x" 6 "xh" [diagonal 6, "M0 0L6 6"]
    <> hatch "bt-s" 5 "sh" ["M0 2.5H5"]
    <> hatch "bt-a" 9 "ah" [diagonal 9]
 where
  hatch name size c ds =
    makeElement "pattern" (ground size c <> mconcat (map (shape c) ds))
      `with` [ makeAttribute "id" name
             , makeAttribute "width" (px size)
             , makeAttribute "height" (px size)
             , makeAttribute "patternUnits" "userSpaceOnUse"
             ]
  ground size c =
    makeElementNoEnd "rect"
      `with` [makeAttribute "class" (c <> "b"), makeAttribute "width" (px size), makeAttribute "height" (px size)]
  diagonal n =
    Text.concat
      ["M0 ", px n, "L", px n, " 0M-1 1L1 -1M", px (n - 1), " ", px (n + 1), "L", px (n + 1), " ", px (n - 1)]
