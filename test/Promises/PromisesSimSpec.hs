-- |
-- The promises that every operator keeps, tested under many schedules, in reality, and
-- with broken operators, which must break them.
module Promises.PromisesSimSpec
  ( spec
  , specWith
  , Effort (..)
  ) where

import Control.Monad (forM_, when)
import Data.IORef
import Data.Maybe (catMaybes)
import Test.Hspec

import Promises.Broken
import Promises.Language (sound)
import Promises.Properties
import Promises.Stage
import Promises.Trying

-- | The amount of testing.
data Effort = Effort
  { randomSchedules :: Int
  -- ^ For each promise.
  , smallPrograms :: Int
  -- ^ For each promise, under all their schedules with up to two pre-emptions.
  , realPrograms :: Int
  -- ^ For each promise.
  , seeds :: Int
  -- ^ For each broken operator.
  }

-- | The amount for each run of the test suite.
spec :: Spec
spec = specWith (Effort 2000 20 50 5)

specWith :: Effort -> Spec
specWith effort = do
  explored <- runIO (newIORef mempty)
  let counting needed act = do
        t <- act
        modifyIORef' explored (<> t)
        schedulesExplored t `shouldSatisfy` (>= needed)
      counted = readIORef explored >>= \t -> putStrLn ("    (explored so far: " ++ show t ++ ")")
  forM_ promises $ \promise -> describe (promised promise) $ do
    it "under random schedules" $
      counting (randomSchedules effort) (underRandom 1 (randomSchedules effort) sound promise)
    it "under all schedules of small programs, with up to two pre-emptions" $
      counting (smallPrograms effort) (underAll 1 2 100000 (smallPrograms effort) sound promise)
    it "in reality" $
      inReality 1 (realPrograms effort) sound promise
  afterAll_ counted . describe "A plain copy of the operators keeps" $
    forM_ promises $ \promise ->
      it (promised promise) $
        counting (randomSchedules effort) (underRandom 1 (randomSchedules effort) copy promise)
  means <- runIO (newIORef [])
  let table = "    schedules until the rejection, on average:"
  afterAll_ (readIORef means >>= mapM_ putStrLn . (table :) . reverse) . describe "A broken operator is rejected:" $
    forM_ mutants $ \mutant ->
      it (what mutant) $ do
        found <- traverse (\seed -> firstRejection 20000 seed (spoken mutant) (breaks mutant)) [1 .. seeds effort]
        when (Nothing `elem` found) $
          expectationFailure ("20,000 schedules did not break: " ++ promised (breaks mutant))
        let total = sum (catMaybes found)
        modifyIORef' means ((padded (show (total `div` seeds effort)) ++ "  " ++ what mutant) :)
 where
  padded text = replicate (8 - length text) ' ' ++ text
