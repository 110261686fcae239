-- |
-- 'resumable': it goes on where it was, and repeats nothing that has returned.
module Behavior.ResumableSpec (spec) where

import Control.Concurrent (yield)
import Control.Exception
import Control.Monad (replicateM_, void, when)
import Data.Foldable (for_)
import Data.IORef
import Data.List (group, nub)
import qualified Data.Map as Map
import Data.Maybe (fromMaybe)
import Test.Hspec
import Test.Hspec.QuickCheck (prop)

import Behavior
import Behavior.STM
import Memory (inConstantMemory)
import Support hiding (Log)

spec :: Spec
spec = guarded $ do
  prop "without an interruption runs the behaviour for each element, in order, and leaves none" $ \scripts ->
    sameAs (\entries -> newTVarIO scripts >>= \left -> resumable left (void . play entries)) (for_ scripts . play)

  it "stays at the element for which the behaviour failed, faulted, or was cancelled" $ do
    left <- newTVarIO "abc"
    let stopAt c how x = when (x == c) how
    ending (resumable left (stopAt 'b' failed)) `shouldReturn` FailedWith "Failed"
    readTVarIO left `shouldReturn` "bc"
    ending (resumable left (stopAt 'b' (throwIO (Fault "arm")))) `shouldReturn` FaultedWith (show (Fault "arm"))
    readTVarIO left `shouldReturn` "bc"
    entered <- newGate
    cancelling (resumable left (stopAt 'c' (open entered >> hang))) (pass entered)
      `shouldReturn` CancelledBy (show (Cancel "the caller"))
    readTVarIO left `shouldReturn` "c"

  it "runs the behaviour in the caller's masking state" $
    for_ [id, mask_, uninterruptibleMask_] $ \inState -> do
      seen <- newIORef []
      here <- inState $ do
        left <- newTVarIO [(), ()]
        resumable left (\() -> getMaskingState >>= \state -> modifyIORef' seen (state :))
        getMaskingState
      readIORef seen `shouldReturn` [here, here]

  it "does not run the behaviour twice for an element whose successor is undefined" $ do
    entries <- newLog
    left <- newTVarIO ('a' : errorWithoutStackTrace "no such place")
    for_ [1, 2 :: Int] $ \_ -> ending (resumable left (note entries)) `shouldReturn` FaultedWith "no such place"
    notes entries `shouldReturn` "a"

  it "goes on to what was added meanwhile" $ do
    entries <- newLog
    left <- newTVarIO "a"
    resumable left $ \c -> note entries c >> when (c == 'a') (atomically (modifyTVar' left (++ "b")))
    notes entries `shouldReturn` "ab"

  it "on real threads, masked, runs the behaviour once for each element, however often it is interrupted" $ do
    done <- newIORef []
    left <- newTVarIO [1 .. 300 :: Int]
    -- Masked, so that the behaviour can be interrupted only while it waits.
    let visit n = do
          ready <- newTVarIO False
          atomically (readTVar ready >>= check) ||| (yield >> atomically (writeTVar ready True))
          modifyIORef' done (n :)
        again = do
          replicateM_ 50 yield
          over <- null <$> readTVarIO left
          if over then pure () else void (mask_ (resumable left visit) ||| replicateM_ 20 yield) >> again
    again
    visited <- reverse <$> readIORef done
    map head (group visited) `shouldBe` nub visited
    visited `shouldBe` [1 .. 300]

  describe "by key" $ do
    prop "is resumable on what is left for the key, and leaves the others alone" $ \scripts known ->
      sameAs
        ( \entries -> do
            progress <- newTVarIO (maybe id (Map.insert 'a') known (Map.singleton 'b' scripts))
            end <- ending (void (resumableFor progress 'a' scripts (void . play entries)))
            left <- readTVarIO progress
            pure (end, Map.findWithDefault scripts 'a' left, Map.lookup 'b' left)
        )
        ( \entries -> do
            left <- newTVarIO (fromMaybe scripts known)
            end <- ending (resumable left (void . play entries))
            rest <- readTVarIO left
            pure (end, rest, Just scripts)
        )

    it "removes the key by its transaction, and not before" $ do
      progress <- newTVarIO (Map.fromList [(2, "x")])
      forget <- resumableFor progress (1 :: Int) "ab" (\_ -> pure ())
      readTVarIO progress `shouldReturn` Map.fromList [(1, ""), (2, "x")]
      atomically forget
      readTVarIO progress `shouldReturn` Map.fromList [(2, "x")]

    it "an order of a hundred thousand steps, in constant memory" $
      inConstantMemory 100000 $ \step -> do
        n <- newIORef (100000 :: Int) >>= readIORef
        progress <- newTVarIO Map.empty
        resumableFor progress 'a' [1 .. n] (const step) >>= atomically

    it "goes on with the steps with which the order began, whatever was done of them" $ do
      progress <- newTVarIO Map.empty
      entries <- newLog
      let step c = note entries c >> when (c == 'x') failed
      for_ ["xa", "yb"] $ \steps -> ending (resumableFor progress 'k' steps step >>= atomically)
      notes entries `shouldReturn` "xx"

    it "a hundred thousand orders, in constant memory" $ do
      progress <- newTVarIO Map.empty
      inConstantMemory 100000 $ \step ->
        for_ [1 .. 50000 :: Int] $ \n -> resumableFor progress n "ab" (const step) >>= atomically

  it "a hundred thousand elements, in constant memory" $
    inConstantMemory 100000 $ \step -> do
      -- (A constant list would be shared, and kept.)
      n <- newIORef (100000 :: Int) >>= readIORef
      left <- newTVarIO [1 .. n]
      resumable left (const step)
