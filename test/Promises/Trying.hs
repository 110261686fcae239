{-# LANGUAGE LambdaCase #-}

-- |
-- Ways to test a promise: under random schedules, under all schedules, and in reality.
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

-- | Tests the given number of random schedules in all, of random programs. The first argument
-- is the number of the first program.
underRandom :: Int -> Int -> Language -> Promise -> IO Tried
underRandom from n language (Promise _ itsSalt gen keeping) =
  mconcat <$> mapM one (take (n `div` perProgram) [from ..])
 where
  one i =
    let program = programFrom (gen Full) (seedOf itsSalt i)
     in tried (show program) (Random perProgram (seedOf itsSalt i)) (\stage -> keeping stage language program)

-- | The seed of a promise's i-th program, which depends on the promise.
seedOf :: Int -> Int -> Int
seedOf itsSalt i = i + 1000003 * itsSalt

-- | How many schedules are tried of each random program.
perProgram :: Int
perProgram = 20

-- | Tests all schedules of small programs. The arguments are the number of the first program,
-- the greatest number of pre-emptions, the greatest number of schedules that a program may
-- have, and how many programs are tested.
underAll :: Int -> Int -> Int -> Int -> Language -> Promise -> IO Tried
underAll from preemptions limit n language (Promise _ itsSalt gen keeping) =
  mconcat <$> mapM one (take n [from ..])
 where
  one i =
    let program = programFrom (gen Tiny) (seedOf itsSalt i)
     in tried (show program) (Exhaustive preemptions limit) (\stage -> keeping stage language program)

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
inReality :: Int -> Int -> Language -> Promise -> IO ()
inReality from n language (Promise _ itsSalt gen keeping) =
  forM_ (take n [from ..]) $ \i -> do
    let program = programFrom (gen Full) (seedOf itsSalt i)
    within 20 (keeping real language program) `catch` \(Broken how) ->
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

-- | The number of the first random schedule under which the promise is broken, if it is within
-- the limit. The programs and the schedules depend on the seed.
firstRejection :: Int -> Int -> Language -> Promise -> IO (Maybe Int)
firstRejection limit seed language (Promise _ _ gen keeping) = go 1
 where
  go i
    | i > limit = pure Nothing
    | otherwise = do
        let program = programFrom (gen Full) (seed * 1000003 + i)
        rejected <- newIORef False
        _ <- tryExplore (randomly 1) {planSearch = Random 1 (seed * 1000003 + i), planOptions = limits} $ \simulating ->
          keeping (simulated simulating) language program
            `catch` \(Broken _) -> writeIORef rejected True
        yes <- readIORef rejected
        if yes then pure (Just i) else go (i + 1)
