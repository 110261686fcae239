{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What there is in this process, counted. Many threads change a number at once, and to read
-- one takes a single instruction.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Runtime.Counter
  ( Counter
  , add
  , total

    -- * What is counted
  , threads
  , simulations
  , sinks
  ) where

import Foreign (Ptr, peek)

-- | A number in a place of its own, which is zero at first.
newtype Counter = Counter (Ptr Int)

-- | Adds to it, in one step.
foreign import ccall unsafe "behavior_lang_add" add :: Counter -> Int -> IO ()

-- | The number that it has now.
total :: Counter -> IO Int
total (Counter place) = peek place

-- | The threads started by this library that have not ended.
foreign import ccall "&behavior_lang_threads" threads :: Counter

-- | The simulations that run.
foreign import ccall "&behavior_lang_simulations" simulations :: Counter

-- | Where events are reported to.
foreign import ccall "&behavior_lang_sinks" sinks :: Counter
