-- |
-- Pseudorandom numbers, which are equal for equal seeds.
module Variation
  ( variation
  ) where

import Data.Bits (shiftR, xor)
import Data.Word (Word64)

import Behavior (Behavior)
import Behavior.STM (atomically, newTVarIO, stateTVar)

-- | Makes a behaviour that returns another factor from 0.8 to 1.2 each time it runs.
variation :: Integer -> IO (Behavior Double)
variation seed = do
  state <- newTVarIO (fromInteger seed)
  pure (factor <$> atomically (stateTVar state next))
 where
  factor word = 0.8 + 0.4 * fromIntegral (word `shiftR` 11) / 2 ^ (53 :: Int)

-- | A step of SplitMix: a number, and the next state.
next :: Word64 -> (Word64, Word64)
next state = (mixed state', state')
 where
  state' = state + 0x9e3779b97f4a7c15
  mixed = folded 31 . (* 0x94d049bb133111eb) . folded 27 . (* 0xbf58476d1ce4e5b9) . folded 30
  folded n word = word `xor` (word `shiftR` n)
