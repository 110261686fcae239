-- |
-- Behaviours that run beside a scoped one.
module Behavior.ScopedSpec (spec) where

import Control.Concurrent
import Control.Concurrent.Async (withAsync)
import Control.Concurrent.STM (STM)
import Control.Exception
import Control.Monad (forever, replicateM_, void)
import Data.Foldable (for_)
import Data.Traversable (for)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Internal.Runtime (living)
import Behavior.Parallel (fork, scoped)
import Behavior.Time (atomically)
import Support

spec :: Spec
spec = guarded $ do
  it "gives the result of the scoped behaviour" $
    scoped (const (pure 'a')) `shouldReturn` 'a'

  it "gives the results of what was forked" $
    scoped
      ( \nursery -> do
          answers <- for [1 .. 10 :: Int] (fork nursery . pure)
          for answers atomically
      )
      `shouldReturn` [1 .. 10]

  it "runs what was forked at the same time as the rest" $
    scoped $ \nursery -> do
      here <- newGate
      there <- newGate
      _ <- fork nursery (open there >> pass here)
      pass there
      open here

  it "has started what was forked when fork returns" $
    scoped $ \nursery -> do
      before' <- living
      _ <- fork nursery hang :: IO (STM ())
      living `shouldReturn` before' + 1

  it "lets what was forked fork in its turn, and everything end together" $ do
    (end, done) <- observing $ \notebook -> do
      inside <- newGate
      let generation nursery n
            | n == 0 = open inside >> hang
            | otherwise = do
                _ <- fork nursery (generation nursery (n - 1 :: Int))
                hang `onException` note notebook n
      scoped $ \nursery -> fork nursery (generation nursery 5) >> pass inside
    end `shouldBe` Gave ()
    done `shouldMatchList` [1 .. 5]

  it "stops what was forked when the scoped behaviour ends, and waits for it" $ do
    (end, done) <- observing $ \notebook ->
      scoped $ \nursery -> do
        inside <- newGate
        _ <- fork nursery ((open inside >> hang) `onException` note notebook "cleaned up")
        pass inside
    (end, done) `shouldBe` (Gave (), ["cleaned up"])

  it "stops the scoped behaviour and all others when something forked fails, and throws that failure" $ do
    (end, done) <- observing $ \notebook ->
      scoped $ \nursery -> do
        inside <- newGate
        there <- newGate
        _ <- fork nursery ((open inside >> hang) `onException` note notebook "other")
        _ <- fork nursery (pass inside >> pass there >> failWith "forked") :: IO (STM ())
        (open there >> hang) `onException` note notebook "scoped"
    end `shouldBe` (FailedWith (show (FailedBecause "forked")) :: Ending ())
    done `shouldMatchList` ["other", "scoped"]

  it "throws the fault of the scoped behaviour before those of the forked, and theirs in their order" $ do
    let faulty gate name' = (open gate >> hang) `onException` throwIO (Fault name') :: IO ()
        faults theirs own = do
          inside <- newGate
          ending . scoped $ \nursery -> do
            for_ theirs $ \name' -> do
              gate <- newGate
              _ <- fork nursery (faulty gate name')
              pass gate
            open inside
            pure () `finally` own
    faults ["first", "second", "third"] (pure ()) `shouldReturn` FaultedWith (show (Fault "first"))
    faults ["first", "second"] (throwIO (Fault "scoped")) `shouldReturn` FaultedWith (show (Fault "scoped"))

  it "is closed outside: to fork there is a fault, and nothing runs" $ do
    (end, done) <- observing $ \notebook -> do
      nursery <- scoped pure
      void (fork nursery (note notebook "ran"))
    (end, done)
      `shouldBe` (FaultedWith "fork: the nursery's scoped behaviour has ended", [])

  it "serves any thread that has the nursery" $
    scoped
      ( \nursery -> do
          answer <- newEmptyMVar
          withAsync (fork nursery (pure 'a') >>= putMVar answer) $ \_ -> takeMVar answer >>= atomically
      )
      `shouldReturn` 'a'

  it "lets a cleanup fork, when all is being stopped: it does not wait, and nothing runs" $ do
    inside <- newGate
    (end, done) <- observing $ \notebook ->
      scoped
        ( \nursery ->
            (open inside >> hang)
              `onException` (fork nursery (note notebook "forked") >> note notebook "went on")
        )
        ||| pass inside
    (end, done) `shouldBe` (Gave (), ["went on"])

  it "throws the failure of what was forked also if the scoped behaviour is just forking" $
    for_ [1 .. 300] $ \n -> do
      end <- ending . scoped $ \nursery -> do
        _ <- fork nursery (yielding n >> failed) :: IO (STM ())
        forever (fork nursery (pure ()))
      end `shouldBe` (FailedWith (show Failed) :: Ending ())

  it "gives the scoped behaviour's result also if what was forked is just forking" $
    for_ [1 .. 300] $ \n -> do
      end <- ending . scoped $ \nursery -> do
        _ <- fork nursery (forever (fork nursery (pure ()))) :: IO (STM ())
        yielding n
      end `shouldBe` Gave ()
 where
  yielding n = replicateM_ (n `mod` 20) yield
