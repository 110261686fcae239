{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE GeneralizedNewtypeDeriving #-}

-- |
-- Durations and points in time.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Core.Seconds
  ( Seconds (..)

    -- * What is allowed
  , duration
  , period
  , moment

    -- * Slots
  , slotAfter
  ) where

import Control.Exception (ErrorCall (..), throwIO)
import Numeric (showFFloat)

-- | A duration, or a point in time on the clock of 'Behavior.Time.now', in seconds.
-- Write it as a literal: @sleep 0.5@; turn other numbers into it with 'realToFrac'.
--
-- @since 0.1.0.0
newtype Seconds = Seconds Double
  deriving (Eq, Ord, Enum, Num, Fractional, Real, RealFrac)

instance Show Seconds where
  -- Shows 0.05 and not 5.0e-2, but still 5.0e-324.
  showsPrec precedence (Seconds s)
    | s /= 0, abs s < 1e-9 = showsPrec precedence s
    | otherwise = showParen (s < 0 && precedence > 6) (showFFloat Nothing s)

instance Read Seconds where
  readsPrec precedence input = [(Seconds s, rest) | (s, rest) <- readsPrec precedence input]

-- | Refuses a number that is no duration: a negative number, or NaN.
duration :: String -> Seconds -> IO Seconds
duration operator seconds
  | seconds >= 0 = pure seconds
  | otherwise = refuse operator "a duration is zero or more seconds" seconds

-- | Refuses a number that is no period: less than a microsecond, which the clock cannot
-- distinguish from zero, or NaN.
period :: String -> Seconds -> IO Seconds
period operator seconds
  | seconds >= 0.000001 = pure seconds
  | otherwise = refuse operator "a period is at least 0.000001 seconds" seconds

-- | Refuses what is no point in time: NaN.
moment :: String -> Seconds -> IO Seconds
moment operator seconds
  | seconds == seconds = pure seconds
  | otherwise = refuse operator "a point in time is a number" seconds

-- | That slot; or if it has been missed, the next that has not. The arguments are the period, the
-- current time, and the slot.
slotAfter :: Seconds -> Seconds -> Seconds -> Seconds
slotAfter interval t slot
  | slot >= t = slot
  | otherwise = slot + interval * fromInteger (ceiling ((t - slot) / interval))

refuse :: String -> String -> Seconds -> IO a
refuse operator allowed seconds =
  throwIO (ErrorCall (operator ++ ": " ++ allowed ++ ", not " ++ show seconds))
