{-# LANGUAGE LambdaCase #-}

-- |
-- Ways to test a promise: under random schedules, under all schedules, and in reality.
module Promises.Trying
  ( Tried (..)
  , underRandom
  , underAll
  , inReality
  , seedOf
  ) where

import Control.Concurrent (ThreadId, yield)
import Control.Exception hiding (Deadlock)
import Control.Monad (forM_, unless)
import Data.IORef
import Data.List (foldl')
import GHC.Conc (ThreadStatus (..), threadStatus)

import Behavior (Behavior)
import Behavior.Internal.Seam.Runtime (interrupt)
import Behavior.Sim
import Promises.Stage
import Support (Cancel (..), endingOf, within)
import qualified Support

-- | The amount of testing that was done.
data Tried = Tried
  { programsTried :: !Int
  , schedulesExplored :: !Int
  , pointsTried :: !Int
  }

instance Semigroup Tried where
  Tried a b c <> Tried a' b' c' = Tried (a + a') (b + b') (c + c')

instance Monoid Tried where
  mempty = Tried 0 0 0

instance Show Tried where
  show t =
    show (programsTried t) ++ " programs, " ++ show (schedulesExplored t) ++ " schedules, "
      ++ show (pointsTried t)
      ++ " scheduling points"

-- | Tests at least the given number of random schedules in all, of random programs. The first argument
-- is the number of the first program.
underRandom :: Int -> Int -> Promise -> IO Tried
underRandom from n (Promise text gen keeping) =
  mconcat <$> mapM one (take ((n + perProgram - 1) `div` perProgram) [from ..])
 where
  one i =
    let program = programFrom (gen Full) (seedOf text i)
     in tried (show program) (Random perProgram (seedOf text i)) (`keeping` program)

-- | The seed of the i-th program for the promise with this text: each promise is tried with other programs. (A
-- hash of the text, by the usual factor; 1000003 is a prime.)
seedOf :: String -> Int -> Int
seedOf text i = i + 1000003 * foldl' (\n c -> (31 * n + fromEnum c) `mod` 1000003) 0 text

-- | How many schedules are tried of each random program.
perProgram :: Int
perProgram = 10

-- | Tests all schedules of small programs. The arguments are the number of the first program,
-- the greatest number of pre-emptions, the greatest number of schedules that a program may
-- have, and how many programs are tested.
underAll :: Int -> Int -> Int -> Int -> Promise -> IO Tried
underAll from preemptions limit n (Promise text gen keeping) =
  mconcat <$> mapM one (take n [from ..])
 where
  one i =
    let program = programFrom (gen Tiny) (seedOf text i)
     in tried (show program) (Exhaustive preemptions limit) (`keeping` program)

tried :: String -> Search -> (Stage -> IO ()) -> IO Tried
tried program how keeping =
  tryExplore (randomly 1) {planSearch = how, planOptions = limits} (keeping . simulated) >>= \case
    Left counterexample -> broken ("of this program:\n" ++ program ++ "\n" ++ show counterexample)
    Right report
      | reportComplete report -> pure (Tried 1 (reportSchedules report) (reportPoints report))
      | otherwise ->
          broken ("there are more than " ++ show (reportSchedules report) ++ " schedules of this program:\n" ++ program)

-- | Limits that no program comes near.
limits :: SimOptions
limits = defaultSimOptions {livelockLimit = 5000, endAt = 1000}

-- | A simulated stage.
simulated :: (Behavior () -> IO (Run ())) -> Stage
simulated simulating =
  Stage
    { run = \act -> do
        end <- newIORef Nothing
        made <- simulating (try act >>= writeIORef end . Just)
        case outcome made of
          Returned () -> readIORef end >>= maybe (broken "it did not end") (pure . endingOf)
          none -> broken (explain none)
    , tick = 1
    , -- The exception is pending until the thread ends (or is raised there if it unmasks before).
      untilOver = \thread -> interrupt thread (Cancel "untilOver")
    }

-- | Tests the given number of random programs in reality, from the one with this number on.
inReality :: Int -> Int -> Promise -> IO ()
inReality from n (Promise text gen keeping) =
  forM_ (take n [from ..]) $ \i -> do
    let program = programFrom (gen Full) (seedOf text i)
    within 20 (keeping real program) `catch` \(Broken how) ->
      broken ("of this program:\n" ++ show program ++ "\n" ++ how)

real :: Stage
real =
  Stage
    { run = Support.ending
    , tick = 0.00001
    , untilOver = over
    }
 where
  over :: ThreadId -> IO ()
  over thread = do
    status <- threadStatus thread
    unless (status `elem` [ThreadFinished, ThreadDied]) (yield >> over thread)
