-- |
-- The simulator against reality.
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

import Reality.Broken
import Reality.Compare
import Reality.Fixed
import Reality.Program
import Reality.Stage
import Support

-- | How much is tried.
data Effort = Effort
  { realRuns :: Int
  -- ^ Of each program whose outcome is fixed.
  , randomSchedules :: Int
  -- ^ Likewise.
  , seed :: Int
  -- ^ Of the random programs.
  , randomPrograms :: Int
  , limit :: Int
  -- ^ One that has more schedules is left out.
  , realRunsOfEach :: Int
  , minutes :: Int
  -- ^ For all of them.
  }

-- | What is tried every time.
spec :: Spec
spec = specWith (Effort 100 200 1 25 1000 200 1)

specWith :: Effort -> Spec
specWith effort = do
  describe "What GHC fixes is so on real threads, and in the simulation:" . around_ (within 60 . leavingNothing) $
    for_ table $ \(group, programs) -> describe group $
      for_ programs $ \fixed ->
        it (called fixed) $ do
          realOutcomes (realRuns effort) (program fixed) `shouldReturn` Set.singleton (says fixed)
          simulatedOutcomes 2 (program fixed) `shouldReturn` Set.singleton (says fixed)
          randomOutcomes (randomSchedules effort) (program fixed) `shouldReturn` Set.singleton (says fixed)
  total <- runIO (newIORef mempty)
  let counted = readIORef total >>= \t -> putStrLn ("    (seed " ++ show (seed effort) ++ ": " ++ show t ++ ")")
  afterAll_ counted . describe "A real run of a random program" . around_ (within (60 * minutes effort) . leavingNothing) $
    it "has an outcome that a simulated one has" $ do
      wrong <- newIORef []
      compareMany id (seed effort) (limit effort) (randomPrograms effort) (realRunsOfEach effort) $ \c -> do
        modifyIORef' total (<> figures c)
        if Set.null (strange c) then pure () else modifyIORef' wrong (c :)
      readIORef wrong >>= \them -> map show them `shouldBe` []
      (several, count) <- programsWithSeveral <$> readIORef total
      2 * several `shouldSatisfy` (>= count)
  describe "A masked branch that is woken by another capability, and has not run since," . around_ (within 60 . leavingNothing) $
    it "may be stopped, in reality as in the simulation" $ do
      outcomes <- inReality (seed effort) 1000 woken
      Just (_, right) <- explored id 10000 woken
      right `shouldBe` Set.fromList [": Gave 'p'", "a: Gave 'p'"]
      Set.difference outcomes right `shouldBe` Set.empty
  describe "It is noticed when an exception waits for its sender to have the turn" . around_ (within 60 . leavingNothing) $ do
    it "by what GHC fixes" $ do
      let differs fixed = (/= Set.singleton (says fixed)) <$> randomOutcomes 50 (late (program fixed))
      found <- filterM differs (concatMap snd table)
      length found `shouldSatisfy` (>= 30)
    it "by an outcome that comes in reality alone" $ do
      outcomes <- inReality (seed effort) 5000 raisedInside
      Just (_, right) <- explored id 100000 raisedInside
      wrong <- randomOutcomes 5000 (late (observed (pure ()) raisedInside))
      Set.difference outcomes right `shouldBe` Set.empty
      Set.difference outcomes wrong `shouldSatisfy` not . Set.null

-- | The branch is asked to stop before it unmasks: it does so inside of onException.
raisedInside :: Program
raisedInside = Parallel (Note 'a') (OnException (Uninterruptible (Note 'b')) (Note 'c'))

-- | The second branch is blocked in a transaction when the first opens the gate, and ends.
woken :: Program
woken = Parallel (Then (Await 1) (Open 0)) (Masked (Then (Open 1) (Then (Await 0) (Note 'a'))))
