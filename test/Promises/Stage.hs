{-# LANGUAGE ExistentialQuantification #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE RankNTypes #-}

-- |
-- The means to test a promise: a stage to run a behaviour on, real or simulated, and
-- actions that can succeed, fail, fault and respond to stop requests in all ways.
module Promises.Stage
  ( -- * Promises
    Promise (..)
  , Size (..)
  , Broken (..)
  , broken
  , programFrom

    -- * The stage
  , Stage (..)
  , pause
  , untilStopped
  , calling
  , Stimulus (..)
  , stopsCaller
  , Outside (..)

    -- * Actions
  , Act (..)
  , End (..)
  , StopResponse (..)
  , perform
  , finish
  , acts
  , ends
  , stopResponses

    -- * Logs
  , Log
  , newLog
  , append
  , readLog
  ) where

import Control.Concurrent (ThreadId)
import Control.Exception
import Data.Foldable (for_)
import Data.IORef
import Test.QuickCheck (Gen, choose, elements, frequency)
import Test.QuickCheck.Gen (unGen)
import Test.QuickCheck.Random (mkQCGen)

import Behavior (Behavior, Seconds, sleep)
import Behavior.Internal.Core.Failure (isCancellation)
import Behavior.Internal.Seam.Runtime
  ( Label (..)
  , threadId
  , atomically
  , checkpoint
  , throwToAll
  , start
  , threadEnd
  )
import Support (Cancel (..), Ending, Failure (..), Fault (..), endingOf)

-- | A promise of the library: random programs, and a test whether one run of one of them
-- kept the promise. It is independent of how the program is run.
data Promise = forall program. Show program => Promise
  { promised :: String
  , programs :: Size -> Gen program
  , kept :: Stage -> program -> IO ()
  -- ^ Runs the program once, and throws 'Broken' if the promise was not kept.
  }

-- | How large the programs are.
data Size
  = -- | Up to three threads: all schedules can be tried.
    Tiny
  | Full
  deriving (Eq, Show)

-- | Thrown when a promise is broken; the text says how.
newtype Broken = Broken String

instance Show Broken where
  show (Broken how) = how

instance Exception Broken

broken :: String -> IO a
broken = throwIO . Broken

-- | The program for this seed.
programFrom :: Gen program -> Int -> program
programFrom gen seed = unGen gen (mkQCGen seed) 10

-- | Where a behaviour is run.
data Stage = Stage
  { run :: forall a. Behavior a -> IO (Ending a)
  -- ^ Runs it to its end. A behaviour that does not end breaks every promise.
  , tick :: Seconds
  -- ^ The unit of time of the programs.
  , untilOver :: ThreadId -> Behavior ()
  -- ^ Waits until a thread that is about to end has ended, and its result is published.
  }

-- | Takes the given number of ticks; zero ticks are a scheduling point.
pause :: Stage -> Int -> Behavior ()
pause stage n
  | n <= 0 = checkpoint
  | otherwise = sleep (fromIntegral n * tick stage)

-- | A number of ticks that never elapses in a test: three hours with the shortest tick.
untilStopped :: Int
untilStopped = 1000000000

-- | An action on a behaviour from outside.
data Stimulus world
  = -- | Cancels its caller by an exception of an asynchronous type.
    CancelsCaller
  | -- | The same, by an exception of a synchronous type.
    ThrowsAtCaller
  | Changes world
  deriving (Eq, Show)

-- | An exception of a synchronous type that is thrown to a caller.
data Outside = Outside
  deriving (Show)

instance Exception Outside

stopsCaller :: Stimulus world -> Bool
stopsCaller = \case
  CancelsCaller -> True
  ThrowsAtCaller -> True
  Changes _ -> False

-- | Runs the behaviour while the stimuli are applied, each the given number of ticks after
-- the one before. Without stimuli, the behaviour runs in the current thread.
calling :: Stage -> (world -> Behavior ()) -> [(Int, Stimulus world)] -> Behavior a -> Behavior (Ending a)
calling _ _ [] act = endingOf <$> try act
calling stage change stimuli act = do
  caller <- mask_ (start (Label "caller" "") act)
  for_ stimuli $ \(after, stimulus) -> do
    pause stage after
    case stimulus of
      CancelsCaller -> throwToAll (const (Cancel "the caller")) [threadId caller]
      ThrowsAtCaller -> throwToAll (const Outside) [threadId caller]
      Changes world -> change world
  endingOf <$> atomically (threadEnd caller)

-- | An action that takes time.
data Act = Act
  { number :: Int
  -- ^ Its result, which is also in the texts of its failures and faults.
  , takes :: Int
  , uninterruptible :: Bool
  -- ^ Whether it is masked uninterruptibly meanwhile.
  , ending :: End
  , cleanup :: Int
  -- ^ How many ticks its cleanup takes after a stop request.
  , stopResponse :: StopResponse
  }
  deriving (Show)

-- | How it ends.
data End = Succeeds | Fails | Faults
  deriving (Bounded, Enum, Eq, Show)

-- | How it ends after a stop request.
data StopResponse = Stops | Completes | FailsToStop | FaultsInCleanup
  deriving (Bounded, Enum, Eq, Show)

-- | Runs the action. If it completes despite a stop request, it returns the negated number.
-- The first argument runs at the start of the action, and can be interrupted; the second runs
-- when the cleanup is interrupted, which only a second stop request does.
perform :: Stage -> Behavior () -> Behavior () -> Act -> Behavior Int
perform stage begun cleanupInterrupted act = work `catch` stopping
 where
  work = do
    begun
    (if uninterruptible act then uninterruptibleMask_ else id) (pause stage (takes act))
    finish (number act) (ending act)
  stopping e
    | isCancellation e = do
        pause stage (cleanup act) `onException` cleanupInterrupted
        case stopResponse act of
          Stops -> throwIO e
          Completes -> pure (negate (number act))
          FailsToStop -> finish (number act) Fails
          FaultsInCleanup -> throwIO (Fault ("the cleanup of " ++ show (number act)))
    | otherwise = throwIO e

finish :: Int -> End -> Behavior Int
finish n Succeeds = pure n
finish n Fails = throwIO (Failure (show n))
finish n Faults = throwIO (Fault (show n))

-- | Random actions, which are short, so that ties are frequent.
acts :: Int -> Gen Act
acts n =
  Act n
    <$> choose (0, 3)
    <*> frequency [(5, pure False), (1, pure True)]
    <*> frequency [(4, pure Succeeds), (2, pure Fails), (1, pure Faults)]
    <*> choose (0, 2)
    <*> stopResponses

ends :: Gen End
ends = elements [minBound .. maxBound]

stopResponses :: Gen StopResponse
stopResponses = frequency [(3, pure Stops), (1, pure Completes), (1, pure FailsToStop), (2, pure FaultsInCleanup)]

-- | A log, the newest entry first. Appending to it is no scheduling point.
newtype Log e = Log (IORef [e])

newLog :: IO (Log e)
newLog = Log <$> newIORef []

append :: Log e -> e -> IO ()
append (Log entries) e = atomicModifyIORef' entries (\es -> (e : es, ()))

-- | The entries, the oldest first.
readLog :: Log e -> IO [e]
readLog (Log entries) = reverse <$> readIORef entries
