{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- What the attacks share. An attack is an action that returns when the promise was kept, and
-- calls 'broken' when it was not.
module Attack
  ( broken
  , liveThreadCount
  , promise
  , endsWithin
  , inThread
  , milliseconds
  , randomBelow
  , Boom (..)
  ) where

import Control.Concurrent
import Control.Exception
import Control.Monad (unless)
import Data.IORef (atomicModifyIORef', newIORef)
import Foreign (Ptr, peek)
import System.Exit (ExitCode (..))
import System.IO (hFlush, stdout)
import System.Posix.Process (exitImmediately)

-- | Prints which promise is broken, and ends the process, whatever still runs.
broken :: String -> IO a
broken why = do
  putStrLn ("BROKEN  " ++ why)
  hFlush stdout
  _ <- exitImmediately (ExitFailure 1)
  throwIO (ErrorCall why)

-- | The number of threads that the library has started and that have not ended.
liveThreadCount :: IO Int
liveThreadCount = peek threads

foreign import ccall "&behavior_lang_threads" threads :: Ptr Int

promise :: String -> Bool -> IO ()
promise what kept = unless kept (broken what)

-- | Runs the action in a thread of its own, in which it must end within the given number of
-- milliseconds, and returns how it ended. The first function gets the thread.
endsWithin :: Int -> String -> (ThreadId -> IO ()) -> IO a -> IO (Either SomeException a)
endsWithin limit what meanwhile act = do
  box <- newEmptyMVar
  thread <- mask_ $ forkIOWithUnmask (\unmask -> try (unmask act) >>= putMVar box)
  meanwhile thread
  waiting limit box
 where
  waiting n box =
    tryTakeMVar box >>= \case
      Just end -> pure end
      Nothing
        | n <= 0 -> broken (what ++ ": this was not over after " ++ show limit ++ " ms")
        | otherwise -> threadDelay 1000 >> waiting (n - 1) box

inThread :: Int -> String -> IO a -> IO (Either SomeException a)
inThread limit what = endsWithin limit what (const (pure ()))

milliseconds :: Int -> IO ()
milliseconds n = threadDelay (n * 1000)

-- | Random numbers from this seed: each is from zero to below the given one. (As the C standard makes them.)
randomBelow :: Int -> IO (Int -> IO Int)
randomBelow seed = do
  state <- newIORef seed
  pure $ \n -> atomicModifyIORef' state $ \s ->
    let s' = (s * 1103515245 + 12345) `mod` 2147483648 in (s', (s' `div` 65536) `mod` n)

newtype Boom = Boom Int
  deriving (Eq, Show)

instance Exception Boom
