{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Counters of this process. Many threads change them at the same time, and reading one takes a
-- single instruction.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Core.Counter
  ( Counter
  , add
  , total

    -- * What is counted
  , threads
  , simulations
  , traces
  ) where

import Foreign (Ptr, peek)

-- | A counter, which is zero at first.
newtype Counter = Counter (Ptr Int)

-- | Adds to the counter, atomically.
foreign import ccall unsafe "behavior_lang_add" add :: Counter -> Int -> IO ()

-- | The current value.
total :: Counter -> IO Int
total (Counter pointer) = peek pointer

-- | The threads started by this library, for branches or for the sinks of traces, that have not ended.
foreign import ccall "&behavior_lang_threads" threads :: Counter

-- | The simulations that run.
foreign import ccall "&behavior_lang_simulations" simulations :: Counter

-- | The traces that are being made, also those of simulations.
foreign import ccall "&behavior_lang_traces" traces :: Counter
