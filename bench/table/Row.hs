-- |
-- The vocabulary for the rows of the table.
module Row
  ( Group (..)
  , Row (..)
  , Figure (..)
  , Target (..)

    -- * Figures
  , shortest
  , scaled
  , summarise
  , over

    -- * Targets
  , within
  , times
  , atMost
  , atLeast
  , noTarget
  , beside

    -- * Units
  , microseconds
  , million
  ) where

import Data.List (sort)
import Data.String (IsString (..))

-- | Rows of one unit, from programs that ran with these runtime options.
data Group = Group
  { heading :: String
  , options :: String
  , rows :: [Row]
  }

data Row = Row
  { ours :: Figure
  , target :: Target
  }

-- | A measurement: its name, how its rounds are summarised, and a factor.
data Figure = Figure
  { summary :: Summary
  , fold :: Double
  , named :: String
  }

data Summary = Median | Shortest

data Target
  = -- | Ours is at most the given number of times theirs.
    Times Double Figure
  | -- | The ratio to theirs is shown.
    Beside Figure
  | AtMost Double
  | AtLeast Double
  | NoTarget

-- | A name alone is the median of its rounds.
instance IsString Figure where
  fromString = Figure Median 1

-- | The summary of its rounds.
summarise :: Figure -> [Double] -> Double
summarise figure rounds = case summary figure of
  Median -> fold figure * median rounds
  Shortest -> fold figure * minimum rounds

-- | The ratio of ours to theirs.
--
-- For medians, it is the median of the ratios of the single turns: noise that lasts for some
-- turns affects both. (If one of them had more rounds than the other, several of its rounds
-- count as one turn.)
over :: (Figure, [Double]) -> (Figure, [Double]) -> Double
over (mine, us) (theirs, them) = case (summary mine, summary theirs) of
  (Median, Median) -> median (zipWith quotient (inTurns us) (inTurns them))
  _ -> quotient us them
 where
  quotient a b = let (x, y) = (summarise mine a, summarise theirs b) in if x == y then 1 else x / y
  turns = min (length us) (length them)
  inTurns rounds = [take (end - begin) (drop begin rounds) | (begin, end) <- zip bounds (drop 1 bounds)]
   where
    bounds = [i * length rounds `div` turns | i <- [0 .. turns]]

median :: [Double] -> Double
median rounds = sort rounds !! (length rounds `div` 2)

-- | Its shortest round: for differences that are smaller than the noise.
shortest :: Figure -> Figure
shortest figure = figure {summary = Shortest}

-- | A multiple of a figure.
scaled :: Double -> Figure -> Figure
scaled n figure = figure {fold = n * fold figure}

within :: Figure -> Target -> Row
within = Row

infix 1 `within`

times :: Double -> Figure -> Target
times = Times

infix 2 `times`

atMost, atLeast :: Figure -> Double -> Row
figure `atMost` bound = Row figure (AtMost bound)
figure `atLeast` bound = Row figure (AtLeast bound)

infix 1 `atMost`, `atLeast`

-- | Shown without a target.
noTarget :: Figure -> Row
noTarget figure = Row figure NoTarget

-- | Shown with the ratio to another figure, without a target.
beside :: Figure -> Figure -> Row
figure `beside` other = Row figure (Beside other)

infix 1 `beside`

-- | In nanoseconds.
microseconds :: Double
microseconds = 1000

million :: Double
million = 1000000
