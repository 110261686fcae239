-- | Two nested System.Timeouts expire while a cleanup stops a slow thread by throwTo. Expected:
-- the outcome in GHC without the library; no Timeout escapes.
module StuckLimits (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM_)
import System.Timeout (timeout)

import Attack
import Behavior

attack :: IO ()
attack =
  forM_ [(outer, inner) | outer <- [60, 150], inner <- [60, 150], outer /= inner] $ \(outer, inner) -> do
    library <- run outer inner (\act -> parallel act act)
    ghc <- run outer inner id
    promise
      ("outer " ++ show outer ++ ", inner " ++ show inner ++ ": " ++ library ++ ", and in GHC " ++ ghc)
      (library == ghc)

-- | The cleanup takes 300 ms: it kills a thread that is uninterruptible for so long.
run :: Int -> Int -> (IO () -> IO ()) -> IO String
run outer inner operator = do
  end <- inThread 5000 "two limits" $ do
    got <- timeout (outer * 1000) $ do
      r <- timeout (inner * 1000) (operator (milliseconds 3600000 `finally` uninterruptibleMask_ slow))
      milliseconds 50
      pure (show r ++ ", then went on")
    milliseconds 300
    pure (show got)
  pure (either (\e -> "escaped: " ++ show e) id end)
 where
  slow = do
    masked <- newEmptyMVar
    other <- mask_ . forkIO $ uninterruptibleMask_ (putMVar masked () >> milliseconds 300)
    takeMVar masked
    killThread other
