-- |
-- What runs in constant memory. (The reactive operators are in
-- "Behavior.ReactiveSpaceSpec".)
module Behavior.SpaceSpec (spec) where

import Control.Exception (throwIO)
import Control.Monad (replicateM_)
import Data.IORef
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Parallel (await, firstOf, fork, requestStop, scoped, tryAwait)
import Behavior.STM (atomically, retry)
import Behavior.Time (every, retrying, timeout)
import Memory (inConstantMemory)
import Support

spec :: Spec
spec = guarded . describe "In constant memory:" $ do
  it "a million failed alternatives, nested to the right by ?" $
    inConstantMemory 1000000 $ \step ->
      foldr (\act others -> (act >> failed) ? others) (pure ()) (replicate 1000000 step)

  it "a million failed inputs of fallbackOver" $
    inConstantMemory 1000000 $ \step ->
      fallbackOver (replicate 1000000 (step >> failed) ++ [pure ()]) id

  it "a million failed attempts" $
    inConstantMemory 1000000 $ \step ->
      attempt 1000000 (step >> failed) ? pure ()

  it "a million tries, after pauses" $
    inConstantMemory 1000000 $ \step ->
      retrying (replicate 1000000 0) (step >> failed) ? pure ()

  it "five thousand periods" $ do
    left <- newIORef (5000 :: Int)
    inConstantMemory 5000 $ \step ->
      every 0.000001 (step >> atomicModifyIORef' left (\n -> (n - 1, n)) >>= \n -> if n <= 1 then failed else pure ())
        ? pure ()

  it "a million recursions through the second behaviour of ?" $
    inConstantMemory 1000000 $ \step -> do
      tries <- newIORef (0 :: Int)
      let again = do
            n <- atomicModifyIORef' tries (\n -> (n + 1, n))
            if n == 1000000 then pure () else (step >> throwIO (Failure "again")) ? again
      again

  it "twenty thousand operators with branches, one after the other" $
    inConstantMemory 20000 $ \step ->
      replicateM_ 4000 $ do
        step >> parallel (pure ()) hang
        step >> both (pure ()) (pure ())
        step >> firstOf [pure (), hang, hang]
        step >> timeout 3600 (pure ())
        step >> scoped (\nursery -> fork nursery (pure ()) >>= atomically . await)

  it "five thousand forks in one scoped behaviour" $
    inConstantMemory 5000 $ \step ->
      scoped $ \nursery ->
        replicateM_ 5000 (step >> fork nursery (pure ()) >>= atomically . await)

  it "five thousand forks in one scoped behaviour, each stopped by its handle" $
    inConstantMemory 5000 $ \step ->
      scoped $ \nursery ->
        replicateM_ 5000 $ do
          step
          child <- fork nursery (sleep 3600)
          requestStop child
          atomically (tryAwait child >>= maybe retry (const (pure ())))
