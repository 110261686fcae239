-- |
-- The words of which the rows of the table are made.
module Row
  ( Group (..)
  , Row (..)
  , Figure (..)
  , Target (..)

    -- * Figures
  , shortest
  , scaled
  , comesTo
  , over

    -- * Targets
  , within
  , times
  , atMost
  , atLeast
  , told
  , beside

    -- * Units
  , microseconds
  , million
  ) where

import Data.List (sort)
import Data.String (IsString (..))

-- | Rows of one unit, from programs with these options of the runtime.
data Group = Group
  { heading :: String
  , options :: String
  , rows :: [Row]
  }

data Row = Row
  { ours :: Figure
  , target :: Target
  }

-- | A measurement by its name: what its rounds come to, and how many of it.
data Figure = Figure
  { summary :: Summary
  , fold :: Double
  , named :: String
  }

data Summary = Median | Shortest

data Target
  = -- | Ours is at most so many times theirs.
    Times Double Figure
  | -- | How many times theirs it is, is told.
    Beside Figure
  | AtMost Double
  | AtLeast Double
  | NoPromise

-- | A name alone is the median of its rounds.
instance IsString Figure where
  fromString = Figure Median 1

-- | What its rounds come to.
comesTo :: Figure -> [Double] -> Double
comesTo figure rounds = case summary figure of
  Median -> fold figure * median rounds
  Shortest -> fold figure * minimum rounds

-- | How many times theirs ours is.
--
-- By medians, that is the median of what it is in each turn: a mood of the machine that lasts
-- for some turns meets both. (If one had more rounds than the other, several of them together
-- were its turn.)
over :: (Figure, [Double]) -> (Figure, [Double]) -> Double
over (mine, ours') (theirs, theirs') = case (summary mine, summary theirs) of
  (Median, Median) -> median (zipWith quotient (inTurns ours') (inTurns theirs'))
  _ -> quotient ours' theirs'
 where
  quotient a b = let (x, y) = (comesTo mine a, comesTo theirs b) in if x == y then 1 else x / y
  turns = min (length ours') (length theirs')
  inTurns rounds = [take (end - begin) (drop begin rounds) | (begin, end) <- zip bounds (drop 1 bounds)]
   where
    bounds = [i * length rounds `div` turns | i <- [0 .. turns]]

median :: [Double] -> Double
median rounds = sort rounds !! (length rounds `div` 2)

-- | Its shortest round, where the differences are smaller than the machine's moods.
shortest :: Figure -> Figure
shortest figure = figure {summary = Shortest}

-- | So many times a figure.
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

-- | To be told, with nothing promised.
told :: Figure -> Row
told figure = Row figure NoPromise

-- | To be told, beside another, with nothing promised.
beside :: Figure -> Figure -> Row
figure `beside` other = Row figure (Beside other)

infix 1 `beside`

-- | In nanoseconds.
microseconds :: Double
microseconds = 1000

million :: Double
million = 1000000
