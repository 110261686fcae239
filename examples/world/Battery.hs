-- |
-- A battery whose level changes at a constant rate, until the rate is changed. Its
-- level is computed when it is read, so no thread has to update it.
module Battery
  ( Battery
  , charged
  , levelAt
  , wholePercent
  , withLevel
  , withRate
  , filled
  , lasts
  , untilFull
  ) where

import Behavior.Time (Seconds)

-- | The level (0 to 100 percent) at a certain moment, and the rate (percent per second)
-- at which the battery has filled or drained since then.
data Battery = Battery
  { level :: Double
  , rate :: Double
  , since :: Seconds
  }
  deriving (Eq, Show)

-- | A battery that has this level at time 0 and keeps it.
charged :: Double -> Battery
charged percent = Battery {level = percent, rate = 0, since = 0}

levelAt :: Seconds -> Battery -> Double
levelAt t b = max 0 (min 100 (level b + rate b * realToFrac (t - since b)))

-- | A level as the robot reads it: rounded to a tenth, then down to a whole percent.
wholePercent :: Double -> Int
wholePercent percent = round (percent * 10) `div` 10

-- | The battery with another level from this moment on.
withLevel :: Seconds -> Double -> Battery -> Battery
withLevel t percent b = b {level = percent, since = t}

-- | The battery with another rate from this moment on; an empty battery stays empty.
withRate :: Seconds -> Double -> Battery -> Battery
withRate t percentASecond b =
  Battery {level = levelNow, rate = if levelNow > 0 then percentASecond else 0, since = t}
 where
  levelNow = levelAt t b

-- | The battery, full; it must not be draining.
filled :: Battery -> Battery
filled b = b {level = 100}

-- | How long it takes from this moment on until the battery is empty.
lasts :: Seconds -> Battery -> Seconds
lasts t b
  | left <= 0 = 0
  | rate b < 0 = realToFrac (left / negate (rate b))
  | otherwise = forEver
 where
  left = levelAt t b

-- | How long it takes from this moment on until the battery is full.
untilFull :: Seconds -> Battery -> Seconds
untilFull t b
  | missing <= 0 = 0
  | rate b > 0 = realToFrac (missing / rate b)
  | otherwise = forEver
 where
  missing = 100 - levelAt t b

forEver :: Seconds
forEver = 1 / 0
