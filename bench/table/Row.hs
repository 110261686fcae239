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

    -- * Targets
  , within
  , times
  , atMost
  , atLeast
  , told

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
  { comesTo :: [Double] -> Double
  , fold :: Double
  , named :: String
  }

data Target
  = -- | Ours is at most so many times theirs.
    Times Double Figure
  | AtMost Double
  | AtLeast Double
  | NoPromise

-- | A name alone is the median of its rounds.
instance IsString Figure where
  fromString = Figure median 1

median :: [Double] -> Double
median rounds = sort rounds !! (length rounds `div` 2)

-- | Its shortest round, where the differences are smaller than the machine's moods.
shortest :: Figure -> Figure
shortest figure = figure {comesTo = minimum}

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

-- | In nanoseconds.
microseconds :: Double
microseconds = 1000

million :: Double
million = 1000000
