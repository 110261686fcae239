-- |
-- Whether a transaction that a task of a simulation waits for can commit.
module Sim.AwaitedSpec (spec) where

import Control.Concurrent (myThreadId, threadCapability)
import Control.Concurrent.STM
import Control.Exception (ErrorCall (..))
import Control.Monad (forM, when)
import Test.Hspec
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck

import Behavior.Internal.Sim.Awaited
import Support (guarded, onOneCapability)

spec :: Spec
spec = guarded . describe "A transaction that waits" $ do
  prop "can commit exactly when it would, after each of random commits" $ \conditions commits ->
    ioProperty . onOneCapability $ do
      capability <- here
      variables <- mapM newTVarIO [1, 2, 3]
      waiting <- mapM (awaited capability . waitsFor variables) conditions
      results <- forM (zip [0 ..] commits) $ \(n, Commit changes) -> do
        atomically (mapM_ (changing variables) changes)
        values <- mapM readTVarIO variables
        can <- mapM (canCommit n) waiting
        pure (can === map ((/= Waits) . endOf values) conditions)
      mapM_ unwatch waiting
      pure (conjoin results)
  it "has waited once it could not commit" . onOneCapability $ do
    capability <- here
    variable <- newTVarIO False
    waiting <- awaited capability (readTVar variable >>= check)
    hasWaited waiting `shouldReturn` False
    canCommit 0 waiting `shouldReturn` False
    atomically (writeTVar variable True)
    canCommit 1 waiting `shouldReturn` True
    hasWaited waiting `shouldReturn` True

-- | What a transaction waits for.
data Condition
  = -- | A variable has this value.
    Is Int Int
  | -- | Two have the same.
    Same Int Int
  | Either Condition Condition
  | Together Condition Condition
  | -- | It throws if a variable has this value, and waits otherwise.
    Throws Int Int
  deriving (Show)

instance Arbitrary Condition where
  arbitrary = sized condition
   where
    condition size
      | size < 5 = simple
      | otherwise = oneof [simple, Either <$> part <*> part, Together <$> part <*> part]
     where
      part = condition (size `div` 3)
    simple = oneof [Is <$> index <*> value, Same <$> index <*> index, Throws <$> index <*> value]

-- | A transaction that changes variables; or it writes what they have, or reads only.
newtype Commit = Commit [(Int, Int)]
  deriving (Show)

instance Arbitrary Commit where
  arbitrary = Commit <$> resize 2 (listOf ((,) <$> index <*> value))

index, value :: Gen Int
index = choose (0, 2)
value = choose (1, 3)

waitsFor :: [TVar Int] -> Condition -> STM ()
waitsFor variables condition = case condition of
  Is i v -> the i >>= check . (== v)
  Same i j -> ((==) <$> the i <*> the j) >>= check
  Either a b -> waitsFor variables a `orElse` waitsFor variables b
  Together a b -> waitsFor variables a >> waitsFor variables b
  Throws i v -> the i >>= \is -> when (is == v) (throwSTM (ErrorCall "thrown")) >> retry
 where
  the i = readTVar (variables !! i)

data End = Waits | Commits | Fails
  deriving (Eq)

-- | What the transaction does when the variables have these values.
endOf :: [Int] -> Condition -> End
endOf values condition = case condition of
  Is i v -> commitsIf (values !! i == v)
  Same i j -> commitsIf (values !! i == values !! j)
  Either a b -> if endOf values a == Waits then endOf values b else endOf values a
  Together a b -> if endOf values a == Commits then endOf values b else endOf values a
  Throws i v -> if values !! i == v then Fails else Waits
 where
  commitsIf is = if is then Commits else Waits

changing :: [TVar Int] -> (Int, Int) -> STM ()
changing variables (i, v) = writeTVar (variables !! i) v

-- | This thread's capability.
here :: IO Int
here = fst <$> (myThreadId >>= threadCapability)
