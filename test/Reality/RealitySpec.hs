-- |
-- Compares the simulator with reality.
module Reality.RealitySpec
  ( spec
  , specWith
  , Effort (..)
  ) where

import Control.Monad (filterM)
import Data.Foldable (for_)
import Data.IORef
import qualified Data.Set as Set
import Test.Hspec

import Language.Operator (Operator (Parallel, Then))
import Language.Primitive
import Reality.Broken
import Reality.Compare
import Reality.Fixed
import Reality.Stage
import Support

-- | The amount of testing.
data Effort = Effort
  { realRuns :: Int
  -- ^ Of each program whose outcome is determined.
  , randomSchedules :: Int
  -- ^ Likewise.
  , seed :: Int
  -- ^ Of the random programs.
  , randomPrograms :: Int
  , limit :: Int
  -- ^ Programs with more schedules are skipped.
  , realRunsOfEach :: Int
  , minutes :: Int
  -- ^ The time limit for all random programs.
  }

-- | The amount for each run of the test suite.
spec :: Spec
spec = specWith (Effort 100 200 1 25 1000 200 1)

specWith :: Effort -> Spec
specWith effort = do
  describe "An outcome that GHC determines is the same on real threads and in the simulation:"
    . around_ (within 60 . leavingNothing) $
      for_ table $ \(group, programs) -> describe group $
        for_ programs $ \fixed ->
          it (title fixed) $ do
            realOutcomes (realRuns effort) (program fixed) `shouldReturn` Set.singleton (expected fixed)
            simulatedOutcomes 2 (program fixed) `shouldReturn` Set.singleton (expected fixed)
            randomOutcomes (randomSchedules effort) (program fixed) `shouldReturn` Set.singleton (expected fixed)
  total <- runIO (newIORef mempty)
  let counted = readIORef total >>= \t -> putStrLn ("    (seed " ++ show (seed effort) ++ ": " ++ show t ++ ")")
  afterAll_ counted . describe "A real run of a random program"
    . around_ (within (60 * minutes effort) . leavingNothing) $
      it "has an outcome that is also simulated" $ do
        wrong <- newIORef []
        compareMany id (seed effort) (limit effort) (randomPrograms effort) (realRunsOfEach effort) $ \c -> do
          modifyIORef' total (<> figures c)
          if Set.null (onlyInReality c) then pure () else modifyIORef' wrong (c :)
        readIORef wrong >>= \them -> map show them `shouldBe` []
        (several, count) <- programsWithSeveral <$> readIORef total
        2 * several `shouldSatisfy` (>= count)
  describe "A masked branch that was woken by another capability, and has not run since,"
    . around_ (within 60 . leavingNothing) $
      it "can be stopped, in reality and in the simulation" $ do
        outcomes <- inReality (seed effort) 1000 woken
        Just (_, right) <- explored id 10000 woken
        right `shouldBe` Set.fromList [": Gave '-'", "a: Gave '-'"]
        Set.difference outcomes right `shouldBe` Set.empty
  describe "A simulator that raises exceptions too late is detected" . around_ (within 60 . leavingNothing) $ do
    it "by an outcome that GHC determines" $ do
      let differs fixed = (/= Set.singleton (expected fixed)) <$> randomOutcomes 50 (late (program fixed))
      found <- filterM differs (concatMap snd table)
      length found `shouldSatisfy` (>= 30)
    it "by an outcome that occurs only in reality" $ do
      outcomes <- inReality (seed effort) 5000 raisedInside
      Just (_, right) <- explored id 100000 raisedInside
      wrong <- randomOutcomes 5000 (late (observed (pure ()) raisedInside))
      Set.difference outcomes right `shouldBe` Set.empty
      Set.difference outcomes wrong `shouldSatisfy` not . Set.null

-- | The second branch receives its stop request at an unmask inside of onException.
raisedInside :: Program
raisedInside = Op (Parallel (Note 'a') (OnException (Uninterruptible (Note 'b')) (Note 'c')))

-- | The second branch is blocked in a transaction when the first opens the gate and ends.
woken :: Program
woken = Op (Parallel (Op (Then (Pass 1) (Open 0))) (Masked (Op (Then (Open 1) (Op (Then (Pass 0) (Note 'a')))))))
