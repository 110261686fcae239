{-# LANGUAGE LambdaCase #-}

-- |
-- How long it takes from the change of a condition to the first step of the recovery and, to
-- compare, to the first step of a thread that waits only for that change: while nothing else
-- runs, while other agents wait, or while another thread computes endlessly; with changes every
-- 0.3 ms (hot), 2 ms (cold) or 5 ms (colder). Prints a line for each figure, in microseconds.
module Main (main) where

import Control.Concurrent
  ( forkIO
  , forkOn
  , getNumCapabilities
  , killThread
  , myThreadId
  , newEmptyMVar
  , putMVar
  , runInUnboundThread
  , takeMVar
  , threadCapability
  )
import Control.Concurrent.STM (check, readTVar)
import qualified Control.Concurrent.STM as STM
import Control.Exception (finally)
import Control.Monad (forever, replicateM_, when)
import Data.List (find)
import System.Environment (getArgs)
import System.Exit (die)
import Text.Read (readMaybe)

import Agent
import Computation
import Measured
import Reaction

main :: IO ()
main =
  runInUnboundThread $
    getArgs >>= \case
      variant : word : load
        | Just reacts <- lookup variant reactors
        , Just gap <- find ((== word) . gapName) gaps ->
            startLoad load >>= measured variant reacts gap
      _ -> usage
 where
  reactors = [("ours", reactor), ("by hand", byHand), ("bare", bare)]

-- | Starts the load, and gives its part of the figures' names.
startLoad :: [String] -> IO String
startLoad = \case
  [] -> processors
  [kind] | Just computation <- lookup kind computations -> do
    -- On another capability than this thread and those that it starts, if there is one.
    -- (This thread is not always on the first.)
    (mine, _) <- threadCapability =<< myThreadId
    _ <- forkOn (mine + 1) computation
    ((kind ++ " ") ++) <$> processors
  [n] | Just agents <- readMaybe n -> ("among " ++ n) <$ crowd agents
  _ -> usage
 where
  processors = ("N" ++) . show <$> getNumCapabilities
  computations = [("busy", searching), ("counting", counting)]

usage :: IO a
usage = die "usage: reaction (ours | \"by hand\" | bare) (hot | cold | colder) [AGENTS | busy | counting]"

-- | Exactly the same steps by hand: a thread waits for the change, stops the task, waits for its
-- end, and starts another thread for the recovery.
byHand :: Probe -> IO ()
byHand probe = forever $ do
  ended <- newEmptyMVar
  recovered <- newEmptyMVar
  task <- forkIO ((putMVar (ready probe) () >> STM.atomically STM.retry) `finally` putMVar ended ())
  STM.atomically (readTVar (flag probe) >>= check)
  killThread task
  takeMVar ended
  _ <- forkIO (reaction probe >> putMVar recovered ())
  takeMVar recovered

-- | The lower bound.
bare :: Probe -> IO ()
bare probe = forever $ do
  putMVar (ready probe) ()
  STM.atomically (readTVar (flag probe) >>= check)
  reaction probe

-- | Changes the condition repeatedly. (With the longer gaps, there are too few changes for the
-- last quantile.)
measured :: String -> (Probe -> IO ()) -> Gap -> String -> IO ()
measured variant reacts gap load = do
  probe <- newProbe
  _ <- forkIO (reacts probe)
  if gapName gap == "hot"
    then reactionTimes probe gap 3 >>= report ["reaction", load] variant (shares ++ [("p99.9", 0.999)])
    else reactionTimes probe gap 2.5 >>= report ["reaction", gapName gap, load] variant shares
 where
  shares = [("p50", 0.5), ("p99", 0.99)]

-- | Other agents, for which nothing changes.
crowd :: Int -> IO ()
crowd n = when (n > 0) $ do
  latch <- newLatch n
  replicateM_ n (newAgent >>= \agent -> forkIO (mission agent (countDown latch)))
  awaitLatch latch
