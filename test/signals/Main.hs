{-# LANGUAGE LambdaCase #-}

-- |
-- Runs programs that call 'runBehavior' repeatedly, sends each of them a signal at a
-- random moment, and checks how it ended.
--
-- > signals 1000
--
-- (The default is 20.)
--
-- Each moment has a process of its own, and its end is awaited. The process must end with
-- 130 after a SIGINT, with 143 after a SIGTERM and with 129 after a SIGHUP (as a shell shows it:
-- a process that was ended by a signal has the status 128 + the number of the signal), and each
-- action that had begun must have run its cleanup.
module Main (main) where

import Control.Concurrent (forkIO, newEmptyMVar, putMVar, takeMVar, threadDelay)
import Control.Exception (bracket_, evaluate)
import Control.Monad (forM, forever, unless, void, when)
import Data.Bits (shiftL, shiftR, xor)
import Data.List (group, sort, unfoldr)
import Data.Maybe (isNothing)
import Data.Word (Word64)
import GHC.Clock (getMonotonicTimeNSec)
import System.Environment (getArgs, getExecutablePath)
import System.Exit (ExitCode (..), die, exitFailure)
import System.IO (BufferMode (..), hGetChar, hGetContents, hSetBuffering, stdout)
import System.Posix.IO (closeFd, createPipe, dupTo, fdToHandle, fdWrite, stdOutput)
import System.Posix.Process (ProcessStatus (..), executeFile, forkProcess, getProcessStatus)
import System.Posix.Signals (Handler (Default), Signal, installHandler, sigHUP, sigINT, sigKILL, sigTERM, signalProcess)
import System.Timeout (timeout)

import Behavior (Behavior, runBehavior, sleep)

main :: IO ()
main = do
  hSetBuffering stdout LineBuffering
  getArgs >>= \case
    ["child", name] | Just act <- lookup name programs -> mark 'r' >> forever (runBehavior act)
    [] -> attack 20
    [moments] | [(n, "")] <- reads moments, n > 0 -> attack n
    _ -> die "signals: the argument is the number of moments for each program, signal and runtime, for example 1000"

-- | The programs that the children run repeatedly.
programs :: [(String, Behavior ())]
programs =
  [ ("sleep", sleep 0.0005)
  , ("pure", pure ())
  , ("cleanup", bracket_ (mark 'b') (mark 'e') (sleep 0.0005))
  ]

-- | Writes a mark to standard output, without a buffer.
mark :: Char -> IO ()
mark c = void (fdWrite stdOutput [c])

attack :: Int -> IO ()
attack n = do
  verdicts <- forM settings $ \(name, (signal, signalName), capabilities) -> do
    ends <- forM (take n (delays (length name + fromIntegral signal + capabilities))) $ \delay ->
      moment name capabilities signal delay
    let bad = filter (/= Fine) ends
    putStrLn . unwords $
      [name, signalName, "-N" ++ show capabilities ++ ":", show (n - length bad), "of", show n]
        ++ [show (length same) ++ " x " ++ show end | same@(end : _) <- group (sort bad)]
    pure (null bad)
  unless (and verdicts) exitFailure
 where
  settings =
    [ (name, signal, capabilities)
    | (name, _) <- programs
    , signal <- [(sigINT, "SIGINT"), (sigTERM, "SIGTERM"), (sigHUP, "SIGHUP")]
    , capabilities <- [1, 2]
    ]

-- | How a child ended.
data End
  = Fine
  | -- | The status that a shell would show.
    WrongStatus Int
  | -- | How many actions had begun, and how many cleanups had run.
    NoCleanup Int Int
  | -- | It still ran after twenty seconds.
    WithoutEffect
  deriving (Eq, Ord, Show)

-- | Runs one child and sends it the signal the given number of nanoseconds after it has
-- begun.
moment :: String -> Int -> Signal -> Word64 -> IO End
moment name capabilities signal delay = do
  self <- getExecutablePath
  (output, input) <- createPipe
  child <- forkProcess $ do
    void (dupTo input stdOutput)
    closeFd output
    closeFd input
    -- (Under nohup it is ignored.)
    _ <- installHandler sigHUP Default Nothing
    executeFile self False ["child", name, "+RTS", "-N" ++ show capabilities] Nothing
  closeFd input
  marks <- fdToHandle output
  'r' <- hGetChar marks
  getMonotonicTimeNSec >>= pause
  signalProcess signal child
  seen <- newEmptyMVar
  void . forkIO $ do
    rest <- hGetContents marks
    void (evaluate (length rest))
    putMVar seen rest
  -- The pipe is closed when the child has ended.
  inTime <- timeout 20000000 (takeMVar seen)
  when (isNothing inTime) $ signalProcess sigKILL child
  status <- getProcessStatus True False child
  pure $ case (inTime, status) of
    (Nothing, _) -> WithoutEffect
    (Just rest, Just end)
      | shown end /= 128 + fromIntegral signal -> WrongStatus (shown end)
      | begun rest /= ended rest -> NoCleanup (begun rest) (ended rest)
    _ -> Fine
 where
  pause since = do
    t <- getMonotonicTimeNSec
    let left = since + delay - min (since + delay) t
    -- The last 0.2 ms are spent without a system call, which would return too late.
    if left > 200000 then threadDelay 50 >> pause since else unless (left == 0) (pause since)
  begun = length . filter (== 'b')
  ended = length . filter (== 'e')

-- | The status as a shell shows it.
shown :: ProcessStatus -> Int
shown status = case status of
  Exited ExitSuccess -> 0
  Exited (ExitFailure code) -> code
  Terminated signal _ -> 128 + fromIntegral signal
  Stopped signal -> 128 + fromIntegral signal

-- | Random times of up to three milliseconds (xorshift; the seed is multiplied by 2^32 over the golden ratio).
delays :: Int -> [Word64]
delays seed = map (`mod` 3000000) (drop 10 (unfoldr (Just . next) (fromIntegral seed * 2654435769 + 1)))
 where
  next x0 = (x3, x3)
   where
    x1 = x0 `xor` (x0 `shiftL` 13)
    x2 = x1 `xor` (x1 `shiftR` 7)
    x3 = x2 `xor` (x2 `shiftL` 17)
