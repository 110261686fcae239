{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE CPP #-}

-- |
-- Sleeping in the operating system, which works even if no GHC thread can run.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Core.OsSleep
  ( osSleep
  ) where

#if defined(mingw32_HOST_OS)
import Control.Concurrent (threadDelay)
#else
import Control.Concurrent (rtsSupportsBoundThreads, threadDelay)
import System.Posix.Unistd (usleep)
#endif

-- | Sleeps for the given number of microseconds. With the threaded runtime, this is a sleep of the
-- operating system: 'threadDelay' needs a thread of the runtime, which may never run while another
-- thread keeps its capability busy.
osSleep :: Int -> IO ()
#if defined(mingw32_HOST_OS)
osSleep = threadDelay
#else
osSleep microseconds
  | rtsSupportsBoundThreads = usleep microseconds
  | otherwise = threadDelay microseconds
#endif
