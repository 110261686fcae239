{-# LANGUAGE LambdaCase #-}

-- |
-- The outcomes of random programs on real threads must be among their simulated outcomes.
module Reality.Compare
  ( Compared (..)
  , onlyInReality
  , compareMany
  , explored
  , inReality

    -- * Figures
  , Figures
  , figures
  , programsWithSeveral
  ) where

import Control.Concurrent (yield)
import Control.Exception
  ( Exception (..)
  , asyncExceptionFromException
  , asyncExceptionToException
  , evaluate
  , throwIO
  , try
  )
import Control.Monad (void)
import Data.IORef
import Data.Set (Set)
import qualified Data.Set as Set

import Behavior.Sim
import Language.Primitive
import Reality.Generate
import Reality.Stage
import Support (within)

-- | A program, and its outcomes.
data Compared = Compared
  { compared :: Program
  , schedulesExplored :: Int
  , simulated :: Set String
  -- ^ The outcomes of all schedules.
  , real :: Set String
  -- ^ The outcomes of real runs.
  }

instance Show Compared where
  show c =
    unlines
      [ show (compared c)
      , "  in reality:        " ++ show (Set.toList (real c))
      , "  in the simulation: " ++ show (Set.toList (simulated c))
      ]

-- | The real outcomes that no simulated run has.
onlyInReality :: Compared -> Set String
onlyInReality c = real c `Set.difference` simulated c

-- | Takes the given number of the seed's programs that have no more schedules than the limit,
-- and runs each the given number of times. The first function wraps each simulated behaviour.
compareMany :: (IO String -> IO String) -> Int -> Int -> Int -> Int -> (Compared -> IO ()) -> IO ()
compareMany rule seed limit many runs found = go many (zip [seed ..] (programs seed))
 where
  go :: Int -> [(Int, Program)] -> IO ()
  go 0 _ = pure ()
  go _ [] = pure ()
  go left ((n, p) : others) =
    explored rule limit p >>= \case
      Nothing -> go left others
      Just (tried, outcomes) -> do
        -- (A deadlock in reality is one that no simulated run has.)
        inThreads <- within 120 (inReality n runs p)
        found (Compared p tried outcomes inThreads)
        go (left - 1) others

-- | How many schedules the program has, and all their outcomes. 'Nothing' if there are more
-- schedules than the limit, or if the program does not end under one of them.
explored :: (IO String -> IO String) -> Int -> Program -> IO (Maybe (Int, Set String))
explored rule limit p
  | size p > 14 = pure Nothing
  | otherwise = outcomesBy (randomly 20) {planOptions = options} >>= maybe (pure Nothing) (const everything)
 where
  everything = outcomesBy (randomly 1) {planSearch = Exhaustive maxBound limit, planOptions = options}
  -- (Those that are kept have far fewer steps; of others, each of a thousand schedules would take as many.)
  options = defaultSimOptions {livelockLimit = 200}
  outcomesBy plan = do
    seen <- newIORef Set.empty
    report <- try . explore plan $ \running -> do
      run <- running (rule (observed (pure ()) p))
      case outcome run of
        Returned end -> modifyIORef' seen (Set.insert end)
        _ -> throwIO Endless
    outcomes <- readIORef seen
    pure $ case report of
      Right whole | reportComplete whole -> Just (reportSchedules whole, outcomes)
      Right _ -> Nothing
      Left Endless -> Nothing

-- | Ends the exploration of a program that does not end. (As a cancellation: it is no counterexample, which would be
-- shrunk.)
data Endless = Endless
  deriving (Show)

instance Exception Endless where
  toException = asyncExceptionToException
  fromException = asyncExceptionFromException

-- | The outcomes of the given number of real runs, whose timing varies.
inReality :: Int -> Int -> Program -> IO (Set String)
inReality seed runs p = do
  state <- newIORef seed
  realOutcomes runs (observed (jitter state) p)

-- | Half of the time does nothing; otherwise yields, or takes a few microseconds. (Random numbers as the C standard
-- makes them.)
jitter :: IORef Int -> IO ()
jitter state = do
  n <- atomicModifyIORef' state (\s -> let s' = (s * 1103515245 + 12345) `mod` 2147483648 in (s', s' `div` 65536))
  case n `mod` 8 of
    0 -> yield
    1 -> yield >> yield
    2 -> yield >> yield >> yield
    3 -> void (evaluate (spin (n `div` 8 `mod` 2000)))
    _ -> pure ()
 where
  spin :: Int -> Int
  spin 0 = 0
  spin k = spin (k - 1)

-- | The numbers of programs, of programs with several simulated outcomes, of schedules, of
-- simulated outcomes, and of simulated outcomes that occurred in reality, too.
data Figures = Figures Int Int Int Int Int

instance Semigroup Figures where
  Figures a b c d e <> Figures a' b' c' d' e' = Figures (a + a') (b + b') (c + c') (d + d') (e + e')

instance Monoid Figures where
  mempty = Figures 0 0 0 0 0

instance Show Figures where
  show (Figures count several tried outcomes met) =
    show count ++ " programs, " ++ show several ++ " of them with several outcomes; " ++ show tried ++ " schedules, "
      ++ show outcomes ++ " outcomes, " ++ show met ++ " of them observed in reality"

figures :: Compared -> Figures
figures c =
  Figures 1 (if n > 1 then 1 else 0) (schedulesExplored c) n (Set.size (Set.intersection (real c) (simulated c)))
 where
  n = Set.size (simulated c)

-- | How many programs have several simulated outcomes, and how many there are.
programsWithSeveral :: Figures -> (Int, Int)
programsWithSeveral (Figures count several _ _ _) = (several, count)
