{-# LANGUAGE OverloadedStrings #-}

-- |
-- The texts of the bars of a timeline.
module Behavior.Trace.Svg.Labels
  ( BarLabel (..)
  , labels
  ) where

import Data.List (intercalate, minimumBy)
import Data.Maybe (listToMaybe, maybeToList)
import Data.Ord (comparing)
import qualified Data.Text as Text
import Graphics.Svg.Core (Element)

import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Recording (Node (..))
import Behavior.Trace.Svg.Draw
import Behavior.Trace.Svg.Layout
import Behavior.Trace.Svg.Outcome

-- | A text of a bar: in which lane, how many of its lines are below the bar, between which pixels, and what to draw,
-- given the upper edge of the bar.
data BarLabel = BarLabel
  { labelLane :: !Int
  , labelLinesBelow :: !Int
  , labelFrom :: !Double
  , labelTo :: !Double
  , labelDrawn :: Double -> [Element]
  }

-- | The names of the bars: in the bar, on two lines if one is too short; or beside it if there is room, with a
-- line to the bar; or cut off. Below it the text of its failure or fault, if there is room for that (and it is
-- wanted), but not over what is there in that lane already. Nothing is further right than the given pixel.
-- The bars have that height.
labels :: Bool -> Double -> Double -> [(Int, (Double, Double))] -> [Mark] -> [BarLabel]
labels notes right h taken = go (-1) 0 0
 where
  go _ _ _ [] = []
  -- The last text in this lane ends at `used`, the last one below its bars at `noted`.
  go lane used noted (m : later)
    | markLane m /= lane = go (markLane m) 0 0 (m : later)
    | otherwise = [BarLabel lane 0 a b drawn | (a, b, drawn) <- found] ++ note ++ go lane used' noted' later
   where
    sameLane = takeWhile ((== lane) . markLane) later
    (found, used', complete) = name right h used m (maybe right markLeft (listToMaybe sameLane))
    (note, noted')
      | notes, not complete, isNoted m || (null found && isAlone m) = below noted m sameLane (null found)
      | otherwise = ([], noted)

  -- From the bar on to the right; or if there is no room, with its name, ending there.
  below noted m later unnamed
    | isNoted m || all isClear placed = (placed, noted')
    | otherwise = ([], noted)
   where
    (placed, noted') = belowAt noted m later unnamed
    -- A name that is not at its bar could be of another one; also one of a sliver, or one that reaches below a bar that
    -- is too short for its own.
    isClear l =
      labelFrom l < markRight m
        && labelTo l > markLeft m
        && (null later || insideOf m > -8)
        && all ((>= 8) . insideOf) (takeWhile ((< labelTo l) . markLeft) later)
  belowAt noted m later unnamed = case (notedLines (room left) (text unnamed), inFull) of
    ([], []) -> ([], noted)
    ([], texts) -> noteAt (end - width texts) texts
    (texts, _) -> noteAt left texts
   where
    inFull = notedLines (room furthest) (text True)
    noteAt x texts =
      ( [ BarLabel
            (markLane m)
            (length texts)
            x
            (x + width texts)
            (\top -> [textAt classes x (top + h + dy) [("", t)] | (dy, t) <- zip [12, 25] texts])
        ]
      , x + width texts + 8
      )
    classes = if isNoted m then "n n" <> outcomeClass (markOutcome m) else "n"
    width texts = maximum (map textWidth texts) * 11 / 12
    left = foldl past (max (markLeft m) noted) there
    past at (l, r) = if at > l && at < r then r else at
    furthest = maximum (noted : [r | (_, r) <- there, r <= left])
    end =
      minimum $
        right - 4 : [l | (l, _) <- there, l >= left] ++ [markLeft o - 6 | o <- later, isNoted o, not (fitsWhole o)]
    there = [interval | (lane, interval) <- taken, lane == markLane m]
    room from = (end - from) * 12 / 11
    text isNamed = inertUpTo 120 (intercalate ": " ([nameOf m | isNamed] ++ maybeToList (whyOf m)))

-- What to draw, given the upper edge of the bar; where it ends; and whether it contains all there is to say.
-- The last text in this lane ends at `used`, the next bar begins at `next`.
name :: Double -> Double -> Double -> Mark -> Double -> ([(Double, Double, Double -> [Element])], Double, Bool)
name right h used m next
  | fitsWhole m = inBar full True
  | isMerged m && inside < 60 = nothingFits
  | single, isExplained, after >= partsWidth full = behind full True
  | inside >= partsWidth short = inBar short False
  | Just (both, False) <- stacked = onTwo both
  | inside >= smallWidth - 6 = small (nameOf m)
  | single, after >= partsWidth full = behind full True
  | single, after >= partsWidth short = behind short False
  | single, next >= right, markLeft m - used - 22 >= partsWidth short = before
  | Just (both, _) <- stacked = onTwo both
  | isReadable cut = small cut
  | otherwise = nothingFits
 where
  single = isAlone m
  w = markRight m - markLeft m
  inside = insideOf m
  after = next - markRight m - 22
  short = [("k", nameOf m)]
  full = fullOf m
  -- (The reason is not said at the change of a signal, nor below the bar.)
  isExplained = case nodeEnd (markNode m) of
    Just (_, StoppedBy (SignalChanged _ _)) -> False
    Just (_, StoppedBy _) -> True
    _ -> False
  stacked
    | h >= 24, inside >= 24 = onTwoLines ((inside + 6) * 1.2) (nameOf m)
    | otherwise = Nothing
  inBar parts = at (markLeft m + 7) parts []
  behind parts = at (markRight m + 14) parts [leader (markRight m - notch) (markRight m + 11)]
  before = at left short [leader (left + partsWidth short + 3) (markLeft m)] False
   where
    left = markLeft m - 14 - partsWidth short
  at left parts more whole =
    ( [(left, left + partsWidth parts, \top -> textAt (groundAt left) left (top + h / 2 + 4) parts : map ($ top) more)]
    , max (markRight m) (left + partsWidth parts)
    , whole
    )
  onTwo (one, two) = inSmall [(-1.5, one), (9, two)]
  small one = inSmall [(3.5, one)]
  inSmall texts =
    ( [ ( left
        , markRight m
        , \top -> [textAt (groundAt left <> " z") left (top + h / 2 + dy) [("", t)] | (dy, t) <- texts]
        )
      ]
    , markRight m
    , False
    )
   where
    left = markLeft m + 5
  smallWidth = textWidth (nameOf m) * 10 / 12
  cut = fitted ((inside + 6) * 1.2) (nameOf m)
  -- Fewer letters could be of any name.
  isReadable = (> 6) . length
  nothingFits = ([], max used (markRight m), False)
  leader from to top = shape "ld" (Text.concat ["M", px from, " ", px (top + h / 2), "H", px to])
  notch = case markOutcome m of
    Stop -> min 4 (w / 4)
    Failure -> min 8 (w / 2)
    _ -> 0
  groundAt left
    | left > markLeft m && left < markRight m = Text.cons 'o' (outcomeClass (markOutcome m))
    | otherwise = ""

fitsWhole :: Mark -> Bool
fitsWhole m = insideOf m >= partsWidth (fullOf m)

-- It is a span that is no mere line.
isAlone :: Mark -> Bool
isAlone m = not (isMerged m) && (markRight m - markLeft m >= 3 || markOutcome m == Running)

insideOf :: Mark -> Double
insideOf m = markRight m - markLeft m - 16

fullOf :: Mark -> [Part]
fullOf m = ("k", nameOf m) : [("", detail) | Just detail <- [detailOf m]]

-- The text of its failure or fault belongs below it, if it is nowhere else.
isNoted :: Mark -> Bool
isNoted m = markOutcome m `elem` [Failure, Fault]

-- The text on one line or two, each no wider than that; or cut off, if much of it remains.
notedLines :: Double -> String -> [String]
notedLines room text
  | textWidth text <= room = [text]
  | Just ((one, two), isCut) <- onTwoLines room text, room >= 70 || not isCut = [one, two]
  | room >= 70 = [fitted room text]
  | otherwise = []

-- The text on two lines of about the same width, and whether it is cut off, because it would be wider than that.
-- Not if its first word is wider.
onTwoLines :: Double -> String -> Maybe ((String, String), Bool)
onTwoLines room text = case (filter fits breaks, takeWhile ((<= room) . textWidth . fst) breaks) of
  (whole@(_ : _), _) -> Just (minimumBy (comparing widest) whole, False)
  ([], cut@(_ : _)) -> Just (fitted room <$> last cut, True)
  ([], []) -> Nothing
 where
  breaks = [(unwords a, unwords b) | k <- [1 .. length parts - 1], let (a, b) = splitAt k parts]
  parts = words (take 200 text)
  fits both = widest both <= room
  widest (a, b) = max (textWidth a) (textWidth b)

nameOf :: Mark -> String
nameOf m
  | isMerged m, [one] <- markNames m = some (markCount m) "span" ++ ": " ++ inertUpTo 60 (nameText one)
  | isMerged m = some (markCount m) "span"
  | otherwise = nameText (spanName (nodeSpan (markNode m)))

detailOf :: Mark -> Maybe String
detailOf m
  | isMerged m = Nothing
  | otherwise = case nodeEnd (markNode m) of
      Just (t, Succeeded) -> Just (took t ++ remark)
      Just (t, StoppedBy (SignalChanged _ _)) -> Just ("stopped after " ++ took t)
      Just (_, how@(StoppedBy _)) -> Just (inertUpTo 200 (howText how))
      Just _ -> whyOf m
      Nothing -> Just "not ended"
 where
  took t = secondsText (t - spanBegan (nodeSpan (markNode m)))
  remark = case markOutcome m of
    RanAgain -> ", ran again"
    CutShort -> ", ended by a signal"
    _ -> ""

whyOf :: Mark -> Maybe String
whyOf m = case nodeEnd (markNode m) of
  _ | isMerged m -> Nothing
  Just (_, how) | isNoted m -> Just (inertUpTo 200 (howText how))
  _ -> Nothing
