{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- What a live page costs the mission: from the change of a condition to the first step of the recovery, in a trace,
-- without a page, with a page that no one reads, and with ten readers (in a process of their own). The three are
-- measured in turn, twenty times. Prints a line for each figure, in microseconds.
module Main (main) where

import Control.Concurrent (runInUnboundThread)
import Control.Concurrent.Async (forConcurrently_)
import Control.Concurrent.QSemN
import Control.Exception (bracket)
import Control.Monad (forever, replicateM_, void)
import Data.ByteString.Lazy (ByteString)
import Data.IORef (newIORef, readIORef, writeIORef)
import Network.WebSockets (defaultConnectionOptions, receiveData, runClientWith, sendTextData)
import System.Environment (getArgs, getExecutablePath)
import System.Exit (die)
import System.IO (hFlush, hGetLine, stdout)
import System.Process

import Behavior
import Behavior.Live
import Behavior.Trace (Sink (..), withTrace)
import Measured
import Reaction

main :: IO ()
main = getArgs >>= \case
  [] -> runInUnboundThread . replicateM_ 20 $ do
    withTrace [Batches (const (pure ()))] sample >>= line "live reaction, no page"
    onPage sample >>= line "live reaction, no reader"
    onPage (withReaders sample) >>= line "live reaction, 10 readers"
  ["readers"] -> readers
  _ -> die "usage: page [readers]"
 where
  onPage act = withLive loopback {pagePort = port} $ \receiving -> withTrace [Batches receiving] act

-- | The median of the reactions of a third of a second.
sample :: Behavior Double
sample = do
  probe <- newProbe
  times <- newIORef []
  parallel (reactor probe) (reactionTimes probe (head gaps) 0.3 >>= writeIORef times)
  quantile 0.5 <$> readIORef times

-- | Ten readers while it runs.
withReaders :: IO a -> IO a
withReaders act = do
  program <- getExecutablePath
  let begin = createProcess (proc program ["readers"]) {std_out = CreatePipe}
      end (_, _, _, process) = terminateProcess process >> void (waitForProcess process)
  bracket begin end $ \(_, output, _, _) -> mapM_ hGetLine output >> act

-- | Says when all are there.
readers :: IO ()
readers = do
  attached <- newQSemN 0
  forConcurrently_ [0 .. 10 :: Int] $ \case
    0 -> waitQSemN attached 10 >> putStrLn "attached" >> hFlush stdout >> forever (waitQSemN attached 1)
    _ -> runClientWith "127.0.0.1" port "/live" defaultConnectionOptions origin $ \connection -> do
      sendTextData connection ("{\"version\":1}" :: ByteString)
      -- ("hello", and then a snapshot.)
      replicateM_ 2 (receive connection)
      signalQSemN attached 1
      forever (receive connection)
 where
  origin = [("Origin", "http://127.0.0.1:18470")]
  receive connection = void (receiveData connection :: IO ByteString)

port :: Int
port = 18470
