{-# LANGUAGE ExistentialQuantification #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE RankNTypes #-}

-- |
-- What promises are tried with: a stage to run a behaviour on, real or simulated, and
-- actions that do on it all that actions may do.
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
  , Deed (..)
  , stopsIt
  , Outside (..)

    -- * Actions
  , Act (..)
  , End (..)
  , Aftermath (..)
  , perform
  , finish
  , acts
  , ends
  , aftermaths

    -- * What is found out
  , Journal
  , newJournal
  , enter
  , journal
  ) where

import Control.Concurrent (ThreadId)
import Control.Exception
import Data.Foldable (for_)
import Data.IORef
import Test.QuickCheck (Gen, choose, elements, frequency)
import Test.QuickCheck.Gen (unGen)
import Test.QuickCheck.Random (mkQCGen)

import Behavior (Behavior, Seconds, sleep)
import Behavior.Internal.Failure (isCancellation)
import Behavior.Internal.Runtime
  ( Label (..)
  , threadId
  , atomically
  , checkpoint
  , throwToAll
  , start
  , threadEnd
  )
import Promises.Language
import Support (Cancel (..), Ending, Failure (..), Fault (..), endingOf)

-- | A promise of the library: programs to try it with, and whether it was kept in one
-- run of one of them. It does not know how the program is run.
data Promise = forall program. Show program => Promise
  { promised :: String
  , programs :: Size -> Gen program
  , kept :: Stage -> Language -> program -> IO ()
  -- ^ Runs the program once, and throws 'Broken' if the promise was not kept.
  }

-- | How large the programs are.
data Size
  = -- | Up to three threads: all schedules can be tried.
    Tiny
  | Full
  deriving (Eq, Show)

-- | What throws when a promise is not kept, and how it was not.
newtype Broken = Broken String

instance Show Broken where
  show (Broken how) = how

instance Exception Broken

broken :: String -> IO a
broken = throwIO . Broken

-- | The program of this number.
programFrom :: Gen program -> Int -> program
programFrom gen seed = unGen gen (mkQCGen seed) 10

-- | Where a behaviour is run.
data Stage = Stage
  { run :: forall a. Behavior a -> IO (Ending a)
  -- ^ Runs it to its end. That it does not come to one breaks every promise.
  , tick :: Seconds
  -- ^ The unit of time of the programs.
  , untilOver :: ThreadId -> Behavior ()
  -- ^ Waits until a thread that will do nothing more has ended, and everybody can see
  -- how.
  }

-- | Takes so many ticks, and is a scheduling point at least.
pause :: Stage -> Int -> Behavior ()
pause stage n
  | n <= 0 = checkpoint
  | otherwise = sleep (fromIntegral n * tick stage)

-- | So many ticks that it does not come to its end: three hours where a tick is the shortest.
untilStopped :: Int
untilStopped = 1000000000

-- | What is done to a behaviour from outside.
data Deed world
  = -- | Its caller is cancelled.
    CancelsIt
  | -- | The same, by an exception of a synchronous type.
    ThrowsAtIt
  | Changes world
  deriving (Eq, Show)

-- | What is thrown at a caller, though it is of a synchronous type.
data Outside = Outside
  deriving (Show)

instance Exception Outside

stopsIt :: Deed world -> Bool
stopsIt = \case
  CancelsIt -> True
  ThrowsAtIt -> True
  Changes _ -> False

-- | Runs the behaviour while these deeds are done, each so many ticks after the one
-- before. With nothing to do the caller is the thread that is there already.
calling :: Stage -> (world -> Behavior ()) -> [(Int, Deed world)] -> Behavior a -> Behavior (Ending a)
calling _ _ [] act = endingOf <$> try act
calling stage change deeds act = do
  caller <- mask_ (start (Label "caller" "") act)
  for_ deeds $ \(after, deed) -> do
    pause stage after
    case deed of
      CancelsIt -> throwToAll (const (Cancel "the caller")) [threadId caller]
      ThrowsAtIt -> throwToAll (const Outside) [threadId caller]
      Changes world -> change world
  endingOf <$> atomically (threadEnd caller)

-- | Something that takes time.
data Act = Act
  { number :: Int
  -- ^ What it returns, and what its failures and faults say.
  , takes :: Int
  , deaf :: Bool
  -- ^ Whether it cannot be interrupted meanwhile.
  , ending :: End
  , cleanup :: Int
  -- ^ How long its cleanup takes when it was asked to stop.
  , aftermath :: Aftermath
  }
  deriving (Show)

-- | How it ends.
data End = Succeeds | Fails | Faults
  deriving (Bounded, Enum, Eq, Show)

-- | How it ends when it was asked to stop.
data Aftermath = Stops | Completes | FailsToStop | FaultsInCleanup
  deriving (Bounded, Enum, Eq, Show)

-- | Does it. Whoever completes although he was asked to stop returns the number with a
-- minus, by which his work is known. The first action is done when it has begun, and
-- hears whatever comes; the second when the cleanup was interrupted: nobody must be asked
-- to stop twice.
perform :: Stage -> Behavior () -> Behavior () -> Act -> Behavior Int
perform stage begun disturbed act = work `catch` asked
 where
  work = do
    begun
    (if deaf act then uninterruptibleMask_ else id) (pause stage (takes act))
    finish (number act) (ending act)
  asked e
    | isCancellation e = do
        pause stage (cleanup act) `onException` disturbed
        case aftermath act of
          Stops -> throwIO e
          Completes -> pure (negate (number act))
          FailsToStop -> finish (number act) Fails
          FaultsInCleanup -> throwIO (Fault ("the cleanup of " ++ show (number act)))
    | otherwise = throwIO e

finish :: Int -> End -> Behavior Int
finish n Succeeds = pure n
finish n Fails = throwIO (Failure (show n))
finish n Faults = throwIO (Fault (show n))

-- | Short, so that ties are frequent.
acts :: Int -> Gen Act
acts n =
  Act n
    <$> choose (0, 3)
    <*> frequency [(5, pure False), (1, pure True)]
    <*> frequency [(4, pure Succeeds), (2, pure Fails), (1, pure Faults)]
    <*> choose (0, 2)
    <*> aftermaths

ends :: Gen End
ends = elements [minBound .. maxBound]

aftermaths :: Gen Aftermath
aftermaths = frequency [(3, pure Stops), (1, pure Completes), (1, pure FailsToStop), (2, pure FaultsInCleanup)]

-- | What happened, the latest first. To write into it is no scheduling point.
newtype Journal e = Journal (IORef [e])

newJournal :: IO (Journal e)
newJournal = Journal <$> newIORef []

enter :: Journal e -> e -> IO ()
enter (Journal entries) e = atomicModifyIORef' entries (\es -> (e : es, ()))

-- | From the beginning.
journal :: Journal e -> IO [e]
journal (Journal entries) = reverse <$> readIORef entries
