{-# LANGUAGE LambdaCase #-}

-- |
-- Programs that run unchanged on real threads and in a simulation, and their outcomes.
--
-- No program sleeps on real threads. Where one thread has to wait until another is blocked,
-- the real run reads that thread's status, and the simulated one sleeps: virtual time
-- passes only when no thread can continue.
module Reality.Stage
  ( -- * Threads of a program
    Member (memberId)
  , member
  , thread
  , throwsTo
  , untilBlocked
  , untilQuiet
  , endOf

    -- * Outcomes
  , realOutcomes
  , simulatedOutcomes
  , randomOutcomes
  ) where

import Control.Concurrent
import Control.Concurrent.STM (STM)
import Control.Exception (SomeException, fromException, mask_)
import Control.Monad (replicateM_, unless)
import Data.Foldable (for_)
import Data.IORef (modifyIORef', newIORef, readIORef)
import Data.Set (Set)
import qualified Data.Set as Set
import GHC.Conc (BlockReason (..), ThreadStatus (..), threadStatus)

import Behavior.Internal.Core.Dispatch (inSimulation)
import Behavior.Internal.Seam.Runtime
import Behavior.Sim
import Support

-- | A thread that a program has started.
data Member a = Member
  { memberId :: ThreadId
  , memberEnd :: STM (Either SomeException a)
  }

-- | Starts a thread, which may not have run yet when this returns.
member :: String -> IO a -> IO (Member a)
member name act = mask_ $ (\new -> Member (threadId new) (threadEnd new)) <$> start (Label name "") act

-- | Starts a thread, and returns once it is blocked or has ended.
thread :: String -> IO a -> IO (Member a)
thread name act = do
  new <- member name act
  untilBlocked new
  pure new

-- | Starts a thread that throws the exception to the target. When this returns, that thread
-- is blocked, or the target has received the exception or has ended.
throwsTo :: Member a -> String -> IO (Member ())
throwsTo target name = thread ("thrower of " ++ name) (interrupt (memberId target) (Cancel name))

-- | Returns once the thread is blocked (in a transaction, or in throwing) or has ended.
untilBlocked :: Member a -> IO ()
untilBlocked target = inSimulation really (const (sleep 1))
 where
  really = eventually $ threadStatus (memberId target) >>= \case
    -- Its exception may still be in flight to another capability.
    ThreadBlocked BlockedOnException -> True <$ replicateM_ 2 everyCapability
    status -> pure (blocked status)

blocked :: ThreadStatus -> Bool
blocked = (`elem` [ThreadBlocked BlockedOnSTM, ThreadBlocked BlockedOnException, ThreadFinished, ThreadDied])

-- | Runs a thread on each capability, after those that were ready before it.
everyCapability :: IO ()
everyCapability = do
  capabilities <- getNumCapabilities
  for_ [1 .. capabilities] $ \c -> forkOn c (pure ()) >>= awaitOver

-- | Returns once the thread and its helper threads are blocked. (A woken thread wakes others,
-- which wake it again; so it must be blocked several times after each capability has run its
-- ready threads.)
untilQuiet :: Member a -> IO ()
untilQuiet target = inSimulation (go (6 :: Int)) (const (sleep 1))
 where
  go 0 = pure ()
  go n = do
    everyCapability
    status <- threadStatus (memberId target)
    go (if blocked status then n - 1 else 6)

-- | Waits for the end of the thread, and returns how it ended.
endOf :: Show a => Member a -> IO String
endOf target =
  atomically (memberEnd target) >>= \case
    Right a -> pure (show a)
    Left e -> pure (maybe ("threw " ++ show e) (\(Cancel name) -> "threw " ++ name) (fromException e))

-- | The outcomes of the given number of real runs.
realOutcomes :: Ord a => Int -> IO a -> IO (Set a)
realOutcomes n program = go n Set.empty
 where
  go 0 seen = pure seen
  go k seen = program >>= \a -> let more = Set.insert a seen in more `seq` go (k - 1) more

-- | The outcomes of all schedules with up to the given number of pre-emptions.
simulatedOutcomes :: Int -> IO String -> IO (Set String)
simulatedOutcomes = exploredBy . exhaustively

-- | The outcomes of the given number of random schedules.
randomOutcomes :: Int -> IO String -> IO (Set String)
randomOutcomes = exploredBy . randomly

exploredBy :: Plan -> IO String -> IO (Set String)
exploredBy plan program = do
  seen <- newIORef Set.empty
  report <- explore plan $ \simulated -> do
    run <- simulated program
    modifyIORef' seen . Set.insert $ case outcome run of
      Returned a | null (leakedThreads run) -> a
      Returned a -> a ++ ", and threads are left: " ++ show (leakedThreads run)
      other -> explain other
  unless (reportComplete report) (fail ("not explored completely: " ++ show report))
  readIORef seen
