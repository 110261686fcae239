{-# OPTIONS_GHC -fobject-code #-}
{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE CPP #-}
{-# LANGUAGE MagicHash #-}
{-# LANGUAGE UnliftedFFITypes #-}

-- |
-- The numbers of threads. (GHC's interpreter cannot call the foreign function that gives them: so this module is
-- always compiled.)
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Core.ThreadNumber
  ( threadNumber
  ) where

#if MIN_VERSION_base(4,19,0)
import GHC.Conc.Sync (ThreadId, fromThreadId)
#else
import Foreign.C.Types (CUInt (..))
import GHC.Conc (ThreadId (..))
import GHC.Exts (ThreadId#)
#endif

-- | A number that no other thread has at the same time.
threadNumber :: ThreadId -> Int
#if MIN_VERSION_base(4,19,0)
threadNumber = fromIntegral . fromThreadId
#else
threadNumber (ThreadId thread) = fromIntegral (getThreadId thread)

-- (Its result has 32 or 64 bits, depending on the version of GHC.)
foreign import ccall unsafe "rts_getThreadId" getThreadId :: ThreadId# -> CUInt
#endif
