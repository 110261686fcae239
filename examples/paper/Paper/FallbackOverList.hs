{-# LANGUAGE RebindableSyntax #-}
{-# OPTIONS_GHC -w #-}

-- | Section 6: fallback over a list of inputs. It has no base case: see the errata.
module Paper.FallbackOverList where

import Behavior.Paper hiding (fallback)

fallback (x:xs) bhvr = bhvr x ? fallback xs bhvr
