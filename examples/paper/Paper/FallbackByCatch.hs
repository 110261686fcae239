{-# LANGUAGE RebindableSyntax #-}
{-# LANGUAGE ScopedTypeVariables #-}
{-# OPTIONS_GHC -w #-}

-- | Section 5: fallback is a @catch@. Its second behaviour runs masked: see the errata.
module Paper.FallbackByCatch where

import Behavior.Paper hiding (fallback, (?))

fallback :: Behavior a -> Behavior a -> Behavior a
fallback bhvr1 bhvr2 = catch bhvr1
    (\(e :: BehaviorFailed) -> bhvr2)
(?) = fallback
