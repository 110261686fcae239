{-# LANGUAGE LambdaCase #-}

-- |
-- Ways to try a promise: under random schedules, under all, and in reality.
module Promises.Trying
  ( Tried (..)
  , underRandom
  , underAll
  , inReality
  , firstRejection
  ) where

import Control.Concurrent (ThreadId, yield)
import Control.Exception hiding (Deadlock)
import Control.Monad (forM_, unless)
import Data.IORef
import GHC.Conc (ThreadStatus (..), threadStatus)

import Behavior (Behavior)
import Behavior.Internal.Runtime (interrupt)
import Behavior.Sim
import Promises.Language (Language)
import Promises.Stage
import Support (Cancel (..), endingOf, within)
import qualified Support

-- | How much was tried.
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

-- | Under so many random schedules in all, of random programs, from this number on.
underRandom :: Int -> Int -> Language -> Promise -> IO Tried
underRandom from n language (Promise name gen keeping) =
  mconcat <$> mapM one (take (n `div` perProgram) [from ..])
 where
  one i =
    let program = programFrom (gen Full) (seedOf name i)
     in tried (show program) (Random perProgram (seedOf name i)) (\stage -> keeping stage language program)

-- | The same number stands for another program with every promise.
seedOf :: String -> Int -> Int
seedOf name i = i + 1000003 * sum (zipWith (*) [1 ..] (map fromEnum name))

-- | So many schedules are tried of each random program.
perProgram :: Int
perProgram = 20

-- | Under all schedules with up to so many pre-emptions, of so many small programs (none
-- may have more than so many schedules), from this number on.
underAll :: Int -> Int -> Int -> Int -> Language -> Promise -> IO Tried
underAll from preemptions limit n language (Promise name gen keeping) =
  mconcat <$> mapM one (take n [from ..])
 where
  one i =
    let program = programFrom (gen Tiny) (seedOf name i)
     in tried (show program) (Exhaustive preemptions limit) (\stage -> keeping stage language program)

tried :: String -> Search -> (Stage -> IO ()) -> IO Tried
tried program how keeping =
  tryExplore (randomly 1) {search = how, runOptions = limits} (keeping . simulated) >>= \case
    Left counterexample -> broken ("of this program:\n" ++ program ++ "\n" ++ show counterexample)
    Right report
      | complete report -> pure (Tried 1 (schedules report) (pointsInAll report))
      | otherwise -> broken ("there are more than " ++ show (schedules report) ++ " schedules of this program:\n" ++ program)

-- | No program comes near them.
limits :: Options
limits = defaults {livelockLimit = 5000, endAt = 1000}

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
    , -- It is pending until the thread ends (and is raised only in one that unmasks before).
      untilOver = \thread -> interrupt thread (Cancel "nobody")
    }

-- | So many random programs, in reality, from this number on.
inReality :: Int -> Int -> Language -> Promise -> IO ()
inReality from n language (Promise name gen keeping) =
  forM_ (take n [from ..]) $ \i -> do
    let program = programFrom (gen Full) (seedOf name i)
    within 20 (keeping real language program) `catch` \(Broken how) -> broken ("of this program:\n" ++ show program ++ "\n" ++ how)

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

-- | The number of the random schedule that is the first under which the promise is not
-- kept, if that is one of so many; the programs and the schedules are those of a seed.
firstRejection :: Int -> Int -> Language -> Promise -> IO (Maybe Int)
firstRejection limit seed language (Promise _ gen keeping) = go 1
 where
  go i
    | i > limit = pure Nothing
    | otherwise = do
        let program = programFrom (gen Full) (seed * 1000003 + i)
        rejected <- newIORef False
        _ <- tryExplore (randomly 1) {search = Random 1 (seed * 1000003 + i), runOptions = limits} $ \simulating ->
          keeping (simulated simulating) language program
            `catch` \(Broken _) -> writeIORef rejected True
        yes <- readIORef rejected
        if yes then pure (Just i) else go (i + 1)
