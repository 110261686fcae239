-- | Being written.
module Behavior.Paper () where
