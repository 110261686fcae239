{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Behaviours that are forked in a scope.
module Behavior.ScopedSpec (spec) where

import Control.Concurrent
import Control.Concurrent.Async (wait, withAsync)
import Control.Exception
import Control.Monad (forever, replicateM, replicateM_, void)
import Data.Foldable (for_)
import Data.Maybe (isNothing)
import Data.Traversable (for)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Internal.Seam.Runtime (liveThreadCount)
import Behavior.Parallel
import Behavior.STM (atomically, check, modifyTVar', newTVarIO, readTVar, writeTVar)
import Behavior.Sim (Outcome (Returned, Threw), Run (outcome), explain, explore, randomly)
import Support

spec :: Spec
spec = guarded $ do
  it "gives the result of the scoped behaviour" $
    scoped (const (pure 'a')) `shouldReturn` 'a'

  it "gives the results of forked behaviours" $
    scoped
      ( \nursery -> do
          answers <- for [1 .. 10 :: Int] (fork nursery . pure)
          for answers (atomically . await)
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
      threadsBefore <- liveThreadCount
      _ <- fork nursery hang :: IO (Child ())
      liveThreadCount `shouldReturn` threadsBefore + 1

  it "lets a forked behaviour fork others, and all end together" $ do
    (end, done) <- observing $ \entries -> do
      hanging <- newTVarIO (0 :: Int)
      let generation nursery n = do
            _ <- if n == 1 then fork nursery hang else fork nursery (generation nursery (n - 1 :: Int))
            (atomically (modifyTVar' hanging (+ 1)) >> hang) `onException` note entries n
      scoped $ \nursery -> fork nursery (generation nursery 5) >> atomically (readTVar hanging >>= check . (== 5))
    end `shouldBe` Gave ()
    done `shouldMatchList` [1 .. 5]

  it "stops what was forked when the scoped behaviour ends, and waits for it" $ do
    (end, done) <- observing $ \entries ->
      scoped $ \nursery -> do
        inside <- newGate
        _ <- fork nursery ((open inside >> hang) `onException` note entries "cleaned up")
        pass inside
    (end, done) `shouldBe` (Gave (), ["cleaned up"])

  it "stops the scoped behaviour and all others when something forked fails, and throws that failure" $ do
    (end, done) <- observing $ \entries ->
      scoped $ \nursery -> do
        inside <- newGate
        there <- newGate
        _ <- fork nursery ((open inside >> hang) `onException` note entries "other")
        _ <- fork nursery (pass inside >> pass there >> failWith "forked") :: IO (Child ())
        (open there >> hang) `onException` note entries "scoped"
    end `shouldBe` (FailedWith (show (FailedBecause "forked")) :: Ending ())
    done `shouldMatchList` ["other", "scoped"]

  it "prefers the fault of the scoped behaviour to those of forked ones, \
     \and that of an earlier fork to a later one's" $ do
    let faulty gate which = (open gate >> hang) `onException` throwIO (Fault which) :: IO ()
        faults theirs own = do
          inside <- newGate
          ending . scoped $ \nursery -> do
            for_ theirs $ \which -> do
              gate <- newGate
              _ <- fork nursery (faulty gate which)
              pass gate
            open inside
            pure () `finally` own
    faults ["first", "second", "third"] (pure ()) `shouldReturn` FaultedWith (show (Fault "first"))
    faults ["first", "second"] (throwIO (Fault "scoped")) `shouldReturn` FaultedWith (show (Fault "scoped"))

  it "prefers the fault of an earlier fork also when children that have ended were forgotten meanwhile" $ do
    let faulty gate which = (open gate >> hang) `onException` throwIO (Fault which) :: IO ()
    end <- ending . scoped $ \nursery -> do
      for_ ["first", "second"] $ \which -> do
        gate <- newGate
        _ <- fork nursery (faulty gate which)
        pass gate
      replicateM_ 14 (fork nursery (pure ()) >>= atomically . await)
    end `shouldBe` FaultedWith (show (Fault "first"))

  it "is closed outside: to fork there is a fault, and nothing runs" $ do
    (end, done) <- observing $ \entries -> do
      nursery <- scoped pure
      void (fork nursery (note entries "ran"))
    (end, done)
      `shouldBe` (FaultedWith "fork: the nursery's scoped behaviour has ended", [])

  it "lets any thread that has the nursery fork" $
    scoped
      ( \nursery -> do
          answer <- newEmptyMVar
          withAsync (fork nursery (pure 'a') >>= putMVar answer) $ \_ -> takeMVar answer >>= atomically . await
      )
      `shouldReturn` 'a'

  it "fails to fork while all is being stopped, in a cleanup of the scoped behaviour or of a child, \
     \and nothing runs" $ do
    inside <- newGate
    insideOther <- newGate
    let forking entries nursery = ending (void (fork nursery (note entries "forked"))) >>= note entries . show
    (end, done) <- observing $ \entries ->
      scoped
        ( \nursery -> do
            _ <- fork nursery ((open insideOther >> hang) `onException` forking entries nursery) :: IO (Child ())
            (open inside >> hang) `onException` forking entries nursery
        )
        ||| (pass inside >> pass insideOther)
    let tooLate = FailedWith (show (FailedBecause "fork: the nursery's scoped behaviour is ending")) :: Ending ()
    (end, done) `shouldBe` (Gave (), [show tooLate, show tooLate])

  it "throws the failure of a forked behaviour also if the scoped behaviour is just forking" $
    for_ [1 .. 300] $ \n -> do
      end <- ending . scoped $ \nursery -> do
        _ <- fork nursery (yielding n >> failed) :: IO (Child ())
        forever (fork nursery (pure ()))
      end `shouldBe` (FailedWith (show Failed) :: Ending ())

  it "gives the scoped behaviour's result also if a forked behaviour is just forking" $
    for_ [1 .. 300] $ \n -> do
      end <- ending . scoped $ \nursery -> do
        _ <- fork nursery (forever (fork nursery (pure ()))) :: IO (Child ())
        yielding n
      end `shouldBe` Gave ()

  it "fails to fork only what has not run, whenever the scope is stopped" $
    void . explore (randomly 1000) $ \simulated -> do
      entries <- newLog
      let body nursery = void (fork nursery (note entries "ran")) `catch` \(_ :: Failed) -> note entries "failed"
      _ <- simulated (scoped body ||| pure ())
      notes entries >>= (`shouldSatisfy` (< 2) . length)

  it "loses no fault of a child, also when it is stopped just as it forgets the children that have ended" $
    void . explore (randomly 300) $ \simulated -> do
      faults <- newTVarIO False
      let faulty = atomically (writeTVar faults True) >> throwIO (Fault "child")
          body nursery =
            replicateM_ 14 (fork nursery (pure ()))
              >> void (fork nursery faulty :: IO (Child ()))
              >> fork nursery (pure ())
              >> hang
      run <- simulated (scoped body ||| atomically (readTVar faults >>= check))
      endOf (outcome run) `shouldBe` FaultedWith (show (Fault "child"))

  it "runs each child once, whichever behaviours fork at once" $
    void . explore (randomly 100) $ \simulated -> do
      run <- simulated . scoped $ \nursery -> do
        runs <- newTVarIO (0 :: Int)
        forked <- allOf (replicate 4 (fork nursery (atomically (modifyTVar' runs (+ 1)))))
        for_ forked (atomically . await)
        atomically (readTVar runs)
      endOf (outcome run) `shouldBe` Gave 4

  describe "what fork returns" children
 where
  yielding n = replicateM_ (n `mod` 20) yield
  endOf = \case
    Returned a -> Gave a
    Threw e -> endingOf (Left e)
    other -> FaultedWith (explain other)

children :: Spec
children = do
  it "gives the result, or throws the failure or the fault, also when scoped has ended" $
    for_
      [ (pure 'a', Gave 'a')
      , (failWith "child", FailedWith (show (FailedBecause "child")))
      , (throwIO (Fault "child"), FaultedWith (show (Fault "child")))
      ]
      $ \(act, expected) -> do
          box <- newEmptyMVar
          end <- ending . scoped $ \nursery -> do
            mayEnd <- newGate
            child <- fork nursery (pass mayEnd >> act)
            putMVar box child
            atomically (tryAwait child) >>= (`shouldBe` True) . isNothing
            open mayEnd
            atomically (await child)
          end `shouldBe` expected
          child <- takeMVar box
          ending (atomically (await child)) `shouldReturn` expected
          (fmap endingOf <$> atomically (tryAwait child)) `shouldReturn` Just expected

  it "throws the failure of a child that has failed to a cleanup that awaits it" $ do
    (_, done) <- observing $ \entries ->
      scoped $ \nursery -> do
        inside <- newGate
        child <- fork nursery (pass inside >> failWith "child") :: IO (Child ())
        (open inside >> hang) `onException` (ending (atomically (await child)) >>= note entries) :: IO ()
    done `shouldBe` [FailedWith (show (FailedBecause "child"))]

  it "throws ChildStopped to a cleanup that awaits a child which was stopped with it, \
     \when the child's cleanup has ended" $ do
    (end, done) <- observing $ \entries ->
      scoped $ \nursery -> do
        inside <- newGate
        insideOther <- newGate
        one <- fork nursery ((open inside >> hang) `onException` note entries "its cleanup") :: IO (Child ())
        _ <- fork nursery $
          (open insideOther >> hang) `onException` (ending (atomically (await one)) >>= note entries . show)
        pass inside
        pass insideOther
    (end, done) `shouldBe` (Gave (), ["its cleanup", show (stopped :: Ending ())])

  it "stops a child when that is requested; the scoped behaviour continues" $ do
    (end, done) <- observing $ \entries ->
      scoped $ \nursery -> do
        inside <- newGate
        child <- fork nursery ((open inside >> hang) `onException` note entries "its cleanup")
        other <- fork nursery (pure 'b')
        pass inside
        requestStop child
        ending (atomically (await child)) >>= (`shouldBe` (stopped :: Ending ()))
        note entries "goes on"
        (,) <$> atomically (await other) <*> (fork nursery (pure 'c') >>= atomically . await)
    (end, done) `shouldBe` (Gave ('b', 'c'), ["its cleanup", "goes on"])

  it "stops a child when another thread, or the child itself, requests that" $
    scoped $ \nursery -> do
      one <- fork nursery hang :: IO (Child ())
      withAsync (requestStop one) $ \_ -> ending (atomically (await one)) `shouldReturn` stopped
      itself <- newEmptyMVar
      child <- fork nursery (takeMVar itself >>= requestStop >> hang) :: IO (Child ())
      putMVar itself child
      ending (atomically (await child)) `shouldReturn` stopped

  it "does not wait for a child whose stop it requests, and can fork others meanwhile" $
    scoped $ \nursery -> do
      inside <- newGate
      mayEnd <- newGate
      child <- fork nursery (uninterruptibleMask_ (open inside >> pass mayEnd) >> hang) :: IO (Child ())
      pass inside
      requestStop child
      (fork nursery (pure 'a') >>= atomically . await) `shouldReturn` 'a'
      requestStop child
      open mayEnd
      ending (atomically (await child)) `shouldReturn` stopped

  it "stops a child only once, however often that is requested, and also when scoped ends" $ do
    (end, done) <- observing $ \entries -> do
      mayEnd <- newGate
      cleaning <- newGate
      let body nursery = do
            inside <- newGate
            -- An interruptible cleanup.
            child <- fork nursery
              ((open inside >> hang) `onException` (open cleaning >> pass mayEnd >> note entries "to its end"))
            pass inside
            requestStop child
            pass cleaning
            requestStop child
            -- The request has been handled when this fork has been.
            void (fork nursery (pure ()))
            pure () :: IO ()
      withThread (scoped body) $ \caller -> do
        pass cleaning
        stillRunning caller
        open mayEnd
        wait caller
    (end, done) `shouldBe` (Gave (), ["to its end"])

  it "keeps the result of a child that completes although its stop was requested" $
    scoped
      ( \nursery -> do
          inside <- newGate
          child <- fork nursery ((open inside >> hang) `catch` \(_ :: SomeAsyncException) -> pure 'a')
          pass inside
          requestStop child
          atomically (await child)
      )
      `shouldReturn` 'a'

  it "throws the fault or the failure of the cleanup of a child whose stop was requested" $
    for_
      [ (throwIO (Fault "cleanup"), FaultedWith (show (Fault "cleanup")))
      , (failWith "cleanup", FailedWith (show (FailedBecause "cleanup")))
      ]
      $ \(cleanup, expected) -> do
          end <- ending . scoped $ \nursery -> do
            inside <- newGate
            child <- fork nursery ((open inside >> hang) `onException` cleanup) :: IO (Child ())
            pass inside
            requestStop child
            hang
          end `shouldBe` (expected :: Ending ())

  it "throws the failure of another child also when the stop of one was requested" $
    for_ [1 .. 300 :: Int] $ \n -> do
      end <- ending . scoped $ \nursery -> do
        child <- fork nursery hang :: IO (Child ())
        _ <- fork nursery (replicateM_ (n `mod` 20) yield >> failWith "other") :: IO (Child ())
        requestStop child
        hang
      end `shouldBe` (FailedWith (show (FailedBecause "other")) :: Ending ())

  it "accepts a stop request for a child that has ended, also while all is being stopped, and outside" $ do
    (end, done) <- observing $ \entries -> do
      child <- scoped $ \nursery -> do
        ended <- fork nursery (pure 'a')
        _ <- atomically (await ended)
        requestStop ended
        inside <- newGate
        _ <-
          fork nursery ((open inside >> hang) `onException` (requestStop ended >> note entries "went on"))
            :: IO (Child ())
        pass inside
        pure ended
      requestStop child
      atomically (await child)
    (end, done) `shouldBe` (Gave 'a', ["went on"])

  it "loses no stop request, whichever thread makes it, and how many are made at once" $
    for_ [1 .. 100 :: Int] $ \_ ->
      scoped $ \nursery -> do
        some <- replicateM 10 (fork nursery hang) :: IO [Child ()]
        others <- replicateM 10 (fork nursery hang)
        for_ some $ \child -> fork nursery (requestStop child)
        for_ others requestStop
        for_ (some ++ others) $ \child -> ending (atomically (await child)) `shouldReturn` stopped

  it "is stopped with all others when its scoped behaviour ends while its stop is being requested" $
    for_ [1 .. 300 :: Int] $ \n -> do
      (child, requester) <- scoped $ \nursery -> do
        child <- fork nursery hang :: IO (Child ())
        requester <- fork nursery (replicateM_ (n `mod` 20) yield >> requestStop child)
        replicateM_ (n `mod` 13) yield
        pure (child, requester)
      ending (atomically (await child)) `shouldReturn` stopped
      ending (atomically (await requester)) >>= (`shouldSatisfy` (`elem` [Gave (), stopped]))
 where
  stopped = FailedWith (show ChildStopped)
