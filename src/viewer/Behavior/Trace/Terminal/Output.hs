{-# LANGUAGE CPP #-}

-- |
-- What the program itself prints while something else is shown in its terminal.
module Behavior.Trace.Terminal.Output
  ( withOutputTo
  ) where

import qualified Data.ByteString as Bytes

#if defined(mingw32_HOST_OS)
-- | Runs the action. (On Windows it prints where it is.)
withOutputTo :: (Bytes.ByteString -> IO ()) -> IO a -> IO a
withOutputTo _ act = act
#else
import Control.Concurrent (forkIO, rtsSupportsBoundThreads, threadDelay)
import Control.Concurrent.MVar (MVar, newEmptyMVar, putMVar, takeMVar)
import Control.Exception (IOException, SomeException, catch, finally, mask, onException, try, uninterruptibleMask_)
import Control.Monad (filterM, unless, void, when)
import Data.Foldable (for_)
import Data.IORef (IORef, atomicModifyIORef', newIORef, readIORef)
import Data.Maybe (isJust)
import System.IO (Handle, hClose, hFlush, hIsOpen, stderr, stdout)
import System.Posix.Files (deviceID, fileID, getFdStatus)
import System.Posix.IO
  ( FdOption (CloseOnExec)
  , closeFd
  , createPipe
  , dup
  , dupTo
  , fdToHandle
  , setFdOption
  , stdError
  , stdOutput
  )
import System.Posix.Terminal (queryTerminal)
import System.Posix.Types (DeviceID, Fd, FileID)
import System.Timeout (timeout)

-- | Runs the action. What the process writes to its standard output and its standard error meanwhile, as far as these
-- are terminals, goes to the function: in pieces, in order, from one thread. So it is for every handle of these
-- descriptors, for foreign code, and for processes that it starts; each of them sees a pipe in place of a terminal.
-- Everything that was written has gone to the function when this returns; except what a process writes that outlives
-- the action.
--
-- If the function does not return, a writer waits when the pipe is full, as it does for a terminal that does not go on.
--
-- Without @-threaded@ the action prints where it is: there a full pipe would stop the thread that reads it.
withOutputTo :: (Bytes.ByteString -> IO ()) -> IO a -> IO a
withOutputTo receive act
  | rtsSupportsBoundThreads = mask $ \restore -> do
      flushed
      redirected <- try (filterM queryTerminal [stdOutput, stdError] >>= redirect)
      case redirected of
        Right (Just (readEnd, back)) -> do
          steps <- newIORef 0
          ended <- newEmptyMVar
          _ <- forkIO (relay receive steps readEnd `finally` hClose readEnd `finally` putMVar ended ())
          restore act `finally` ((flushed `finally` uninterruptibleMask_ back) >> await steps ended)
        Right Nothing -> restore act
        Left e -> let _ = e :: IOException in restore act
  | otherwise = act
 where
  flushed = for_ [stdout, stderr] $ \h ->
    void (try (hIsOpen h >>= \open -> if open then hFlush h else pure ()) :: IO (Either IOException ()))

-- Until all have closed the other end. (Whatever happens, it is read: otherwise those who print would wait for ever.)
-- It counts two steps for each piece: so the number is odd while the function receives one.
relay :: (Bytes.ByteString -> IO ()) -> IORef Int -> Handle -> IO ()
relay receive steps readEnd = do
  piece <- Bytes.hGetSome readEnd 65536
  unless (Bytes.null piece) $ do
    step
    receive piece `catch` ignored
    step
    -- What comes soon after it goes together; what does not fit into the pipe does not wait.
    when (Bytes.length piece < 65536) (threadDelay 20000)
    relay receive steps readEnd
 where
  step = atomicModifyIORef' steps (\n -> (n + 1, ()))
  ignored :: SomeException -> IO ()
  ignored _ = pure ()

-- Until all has been received. Where a process that lives longer has the other end, that is when nothing has come for a
-- tenth of a second.
await :: IORef Int -> MVar () -> IO ()
await steps ended = do
  before <- readIORef steps
  isOver <- timeout 100000 (takeMVar ended)
  after <- readIORef steps
  unless (isJust isOver || before == after && even after) (await steps ended)

-- These descriptors lead to a pipe: its end to read from, and what undoes that.
redirect :: [Fd] -> IO (Maybe (Handle, IO ()))
redirect [] = pure Nothing
redirect fds = do
  (readEnd, writeEnd) <- createPipe
  setFdOption readEnd CloseOnExec True
  pipe <- identity writeEnd
  saved <- mapM (\fd -> (,) fd <$> dup fd) fds `onException` (closeFd readEnd >> closeFd writeEnd)
  for_ saved $ \(_, terminal) -> setFdOption terminal CloseOnExec True
  let back = for_ saved $ \(fd, terminal) -> do
        -- Unless the program itself has made it lead to something else.
        there <- try (identity fd) :: IO (Either IOException (DeviceID, FileID))
        unless (either (const False) (/= pipe) there) (void (dupTo terminal fd))
        closeFd terminal
  for_ fds (dupTo writeEnd)
  closeFd writeEnd
  h <- fdToHandle readEnd
  pure (Just (h, back))
 where
  identity fd = (\s -> (deviceID s, fileID s)) <$> getFdStatus fd
#endif
