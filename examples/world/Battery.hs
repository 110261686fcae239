-- |
-- A battery whose level changes at a constant rate, until the rate is changed. Its
-- level is computed when it is asked for, so that nothing has to tick.
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

-- | The level (0 to 100 percent) that it had at some moment, and since then the
-- rate (percent a second) at which it fills or drains.
data Battery = Battery
  { level :: Double
  , rate :: Double
  , since :: Seconds
  }
  deriving (Eq, Show)

-- | A battery of this level at the time 0, which keeps it.
charged :: Double -> Battery
charged percent = Battery {level = percent, rate = 0, since = 0}

levelAt :: Seconds -> Battery -> Double
levelAt t b = max 0 (min 100 (level b + rate b * realToFrac (t - since b)))

-- | A level as it is read: whole percents, of a level known to a tenth.
wholePercent :: Double -> Int
wholePercent percent = round (percent * 10) `div` 10

-- | The battery, from this moment on with another level.
withLevel :: Seconds -> Double -> Battery -> Battery
withLevel t percent b = b {level = percent, since = t}

-- | The battery, from this moment on with another rate; but an empty one stays empty.
withRate :: Seconds -> Double -> Battery -> Battery
withRate t percentASecond b =
  Battery {level = levelNow, rate = if levelNow > 0 then percentASecond else 0, since = t}
 where
  levelNow = levelAt t b

-- | The battery, full; it must not be draining.
filled :: Battery -> Battery
filled b = b {level = 100}

-- | How long it lasts from this moment on: until it is empty.
lasts :: Seconds -> Battery -> Seconds
lasts t b
  | left <= 0 = 0
  | rate b < 0 = realToFrac (left / negate (rate b))
  | otherwise = forEver
 where
  left = levelAt t b

-- | How long it takes from this moment on until it is full.
untilFull :: Seconds -> Battery -> Seconds
untilFull t b
  | missing <= 0 = 0
  | rate b > 0 = realToFrac (missing / rate b)
  | otherwise = forEver
 where
  missing = 100 - levelAt t b

forEver :: Seconds
forEver = 1 / 0
