{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE CPP #-}

-- |
-- To sleep while GHC's own threads may be kept from running.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.OsSleep
  ( osSleep
  ) where

#if defined(mingw32_HOST_OS)
import Control.Concurrent (threadDelay)
#else
import Control.Concurrent (rtsSupportsBoundThreads, threadDelay)
import System.Posix.Unistd (usleep)
#endif

-- | Sleeps for the given number of microseconds. With the threaded runtime in the operating system:
-- 'threadDelay' needs a thread of the runtime's own, which may never have its turn while
-- another one keeps its capability busy.
osSleep :: Int -> IO ()
#if defined(mingw32_HOST_OS)
osSleep = threadDelay
#else
osSleep microseconds
  | rtsSupportsBoundThreads = usleep microseconds
  | otherwise = threadDelay microseconds
#endif
