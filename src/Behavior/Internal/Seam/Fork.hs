{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE CPP #-}
{-# LANGUAGE MagicHash #-}
{-# LANGUAGE UnboxedTuples #-}

-- |
-- Forking a thread without the exception handler that 'Control.Concurrent.forkIO' installs: the library's threads
-- catch everything themselves.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Seam.Fork
  ( Placement (..)
  , fork
  , unmasked
  ) where

import Control.Concurrent (ThreadId, myThreadId, threadCapability)
import GHC.Conc (ThreadId (ThreadId))
import GHC.Exts (Int (I#), fork#, forkOn#, unmaskAsyncExceptions#)
import GHC.IO (IO (IO))

-- | On which of GHC's capabilities a thread runs.
data Placement
  = -- | Like the thread that starts it: if that is pinned, on the same capability; otherwise
    -- wherever GHC moves it.
    Inherited
  | -- | Always on the capability of the thread that starts it.
    Pinned
  | -- | Wherever GHC moves it.
    Unpinned
  deriving (Eq)

-- | Forks a thread with that placement, in the caller's masking state. The action must not throw: nothing would
-- report it.
fork :: Placement -> IO () -> IO ThreadId
fork placement act = do
  (capability, pinned) <- threadCapability =<< myThreadId
  if placement == Pinned || placement == Inherited && pinned then forkAt capability act else forkAnywhere act
{-# INLINE fork #-}

forkAnywhere :: IO () -> IO ThreadId
forkAt :: Int -> IO () -> IO ThreadId
#if MIN_VERSION_base(4,17,0)
forkAnywhere (IO act) = IO $ \s -> case fork# act s of (# s', thread #) -> (# s', ThreadId thread #)
forkAt (I# n) (IO act) = IO $ \s -> case forkOn# n act s of (# s', thread #) -> (# s', ThreadId thread #)
#else
forkAnywhere act = IO $ \s -> case fork# act s of (# s', thread #) -> (# s', ThreadId thread #)
forkAt (I# n) act = IO $ \s -> case forkOn# n act s of (# s', thread #) -> (# s', ThreadId thread #)
#endif

-- | Runs the action unmasked, whatever the masking state.
unmasked :: IO a -> IO a
unmasked (IO act) = IO (unmaskAsyncExceptions# act)
{-# INLINE unmasked #-}
