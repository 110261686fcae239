-- |
-- The seam without its switch, as if there were no simulation: what the library would
-- cost then.
module Behavior.Internal.Seam (inSimulation) where

import Behavior.Internal.Simulator

inSimulation :: IO a -> (Simulator -> IO a) -> IO a
inSimulation really _ = really
{-# INLINE inSimulation #-}
