{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Where an exception that is thrown from one simulated thread to another is raised.
module Sim.DeliverySpec (spec) where

import Control.Concurrent
import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
import qualified Control.Concurrent.STM as STM
import Control.Exception hiding (Deadlock)
import Control.Monad (forM_, void)
import Data.IORef
import Data.List (isInfixOf, nub)
import GHC.Conc (BlockReason (..), ThreadStatus (..), threadStatus)
import System.Mem (performMajorGC)
import System.Mem.Weak (deRefWeak)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Internal.Seam.Runtime
import Behavior.Parallel (firstOf)
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Time (timeout)
import Support

spec :: Spec
spec = guarded $ do
  describe "An exception that finds its target masked is raised" $ do
    describe "at the unmask, under each of 1,000 schedules," atTheUnmask
    describe "as in GHC:" asGHC
  describe "The thread that throws it" throwers
  describe "A branch" endOfBranch

-- | How the run ends under 1,000 schedules.
everyEnd :: Show a => Behavior a -> IO [String]
everyEnd act =
  nub . map (described . outcome)
    <$> mapM (\seed -> simulateWith defaultSimOptions {scheduled = Seeded seed} act) [1 .. 1000]
 where
  described end = case end of
    Returned a -> show a
    other -> explain other

atTheUnmask :: Spec
atTheUnmask = do
  late "if a checkpoint follows" (uninterruptible >> checkpoint)
  late "if the clock is read" (uninterruptible >> void now)
  late "if a checkpoint is restored within a mask" (mask $ \restore -> uninterruptible >> restore checkpoint)
  late "if nothing follows" uninterruptible
  late "if an empty action is restored within a mask" (mask $ \restore -> uninterruptible >> restore (pure ()))
  late "if the target waits for a loser that is slow to stop"
    (firstOf [sleep 0.1, sleep 9 `onException` uninterruptible])
 where
  late name act =
    it name $ everyEnd (timeout 0.15 (act >> pure "done") ? pure "timed out") `shouldReturn` [show "timed out"]
  uninterruptible = uninterruptibleMask_ (sleep 0.2)

-- | Runs a target thread and an action that throws to it once the target has signalled that it
-- is masked. Returns what the target has recorded, and then how it ended.
thrownAt :: ((String -> IO ()) -> IO () -> IO ()) -> (ThreadId -> IO ()) -> Behavior [String]
thrownAt target throws = do
  logged <- newIORef []
  masked <- newTVarIO False
  let record text = modifyIORef logged (text :)
      ready = atomically (writeTVar masked True)
  thread <- mask_ (start (Label "target" "") (target record ready))
  atomically (readTVar masked >>= STM.check)
  throws (threadId thread)
  end <- atomically (threadEnd thread)
  record (either show (const "returned") end)
  reverse <$> readIORef logged

asGHC :: Spec
asGHC = do
  it "several exceptions in the same order as in GHC" $ do
    run <- simulate $ do
      opened <- newTVarIO False
      thrownAt
        ( \record ready -> mask $ \restore -> do
            ready
            uninterruptibleMask_ (atomically (readTVar opened >>= STM.check))
            untilNone (restore (pure ())) record
        )
        ( \target -> do
            mapM_ (\name -> throwToIt target name >> sleep 1) ["a", "b", "c"]
            atomically (writeTVar opened True)
        )
    order <- realOrder ["a", "b", "c"]
    returned run `shouldBe` Just (order ++ ["returned"])
  it "not at an operation that need not block, but at one that blocks" $ do
    run <- simulate $ do
      opened <- newTVarIO False
      thrownAt
        ( \record ready -> mask_ $ do
            ready
            uninterruptibleMask_ (atomically (readTVar opened >>= STM.check))
            checkpoint >> record "went on"
            _ <- now
            record "and on"
            atomically STM.retry `catch` \(e :: Cancel) -> record (show e)
        )
        (\target -> throwToIt target "a" >> sleep 1 >> atomically (writeTVar opened True))
    returned run `shouldBe` Just ["went on", "and on", show (Cancel "a"), "returned"]
  it "by interruptible, within a mask" $ do
    run <- simulate $ do
      opened <- newTVarIO False
      thrownAt
        ( \record ready -> mask_ $ do
            ready
            uninterruptibleMask_ (atomically (readTVar opened >>= STM.check))
            record "went on"
            interruptible (record "not this")
        )
        (\target -> throwToIt target "a" >> sleep 1 >> atomically (writeTVar opened True))
    returned run `shouldBe` Just ["went on", show (Cancel "a")]
  it "where a thread that has not started first unmasks" $ do
    ran <- newIORef False
    forM_ [1 .. 300] $ \seed -> do
      writeIORef ran False
      run <- simulateWith defaultSimOptions {scheduled = Seeded seed} $ do
        thread <- mask_ (start (Label "target" "") (checkpoint >> writeIORef ran True >> atomically STM.retry))
        interrupt (threadId thread) (Cancel "a")
        atomically (threadEnd thread)
      fmap (either (show :: SomeException -> String) (\() -> "returned")) (returned run)
        `shouldBe` Just (show (Cancel "a"))
  it "at once if a thread throws it to itself, in any masking state" $ do
    run <- simulate (uninterruptibleMask_ (myThreadId >>= \me -> interrupt me (Cancel "me") >> pure "went on"))
    explain (outcome run) `shouldBe` "it was cancelled: " ++ show (Cancel "me")
  it "and is in the steps of the run at that time" $ do
    run <- simulate $ do
      opened <- newTVarIO False
      thrownAt
        ( \_ ready -> mask $ \restore -> do
            ready
            uninterruptibleMask_ (atomically (readTVar opened >>= STM.check) >> sleep 1)
            annotate "unmasks"
            restore (pure ()) `catch` \(_ :: Cancel) -> annotate "handles"
        )
        (\target -> throwToIt target "a" >> sleep 1 >> atomically (writeTVar opened True))
    [(stepTime s, stepKind s) | s <- steps run, stepLabel s == Label "target" "", stepKind s `notElem` [Starts, Ends]]
      `shouldBe` [(2, Note "unmasks"), (2, ReceivesException (show (Cancel "a"))), (2, Note "handles")]

-- | Unmasks until nothing is raised any more.
untilNone :: IO () -> (String -> IO ()) -> IO ()
untilNone unmasking record =
  try unmasking >>= either (\(e :: Cancel) -> record (show e) >> untilNone unmasking record) pure

-- | The order in which GHC raises exceptions that are pending on one thread, all thrown from
-- its own capability.
realOrder :: [String] -> IO [String]
realOrder names = do
  logged <- newIORef []
  (here, _) <- threadCapability =<< myThreadId
  end <- newEmptyMVar
  _ <- mask_ $ forkOnWithUnmask here $ \unmask -> do
    me <- myThreadId
    forM_ names $ \name -> do
      thrower <- forkOnWithUnmask here (\free -> free (throwTo me (Cancel name)))
      eventually ((== ThreadBlocked BlockedOnException) <$> threadStatus thrower)
    untilNone (unmask (pure ())) (\text -> modifyIORef logged (text :))
    putMVar end ()
  takeMVar end
  reverse <$> readIORef logged

throwToIt :: ThreadId -> String -> IO ()
throwToIt target name = throwToAll (const (Cancel name)) [target]

returned :: Run a -> Maybe a
returned run = case outcome run of
  Returned a -> Just a
  _ -> Nothing

throwers :: Spec
throwers = do
  it "blocks until it is raised" $ do
    run <- simulate $ do
      target <- mask_ (start (Label "target" "") (uninterruptibleMask_ (sleep 5)))
      sleep 1
      interrupt (threadId target) (Cancel "a")
      now
    returned run `shouldBe` Just 5
  it "continues when its target ends without receiving it, and at once if the target has ended" $ do
    run <- simulate $ do
      target <- mask_ (start (Label "target" "") (uninterruptibleMask_ (sleep 3 >> throwIO (Fault "bug"))))
      sleep 1
      interrupt (threadId target) (Cancel "a")
      first <- now
      end <- atomically (threadEnd target)
      interrupt (threadId target) (Cancel "b")
      (,,) first <$> now <*> pure (either (show :: SomeException -> String) (\() -> "returned") end)
    returned run `shouldBe` Just (3, 3, show (Fault "bug"))
  it "has thrown nothing if it is interrupted while it blocks" $
    everyEnd
      ( do
          target <- mask_ (start (Label "target" "") (uninterruptibleMask_ (sleep 5) >> checkpoint))
          sender <- mask_ (start (Label "sender" "") (sleep 1 >> interrupt (threadId target) (Cancel "a")))
          sleep 2
          interrupt (threadId sender) (Cancel "b")
          (,) <$> fmap shown (atomically (threadEnd sender)) <*> fmap shown (atomically (threadEnd target))
      )
      `shouldReturn` [show (show (Cancel "b"), "returned")]
  it "receives its own pending exception first, and then has thrown nothing" $
    everyEnd
      ( do
          opened <- newTVarIO False
          target <- mask_ (start (Label "target" "") (uninterruptibleMask_ (sleep 5) >> checkpoint))
          sender <- mask_ . start (Label "sender" "") $ mask_ $ do
            uninterruptibleMask_ (atomically (readTVar opened >>= STM.check))
            interrupt (threadId target) (Cancel "a")
          throwToAll (const (Cancel "b")) [threadId sender]
          sleep 1
          atomically (writeTVar opened True)
          (,) <$> fmap shown (atomically (threadEnd sender)) <*> fmap shown (atomically (threadEnd target))
      )
      `shouldReturn` [show (show (Cancel "b"), "returned")]
  it "is named in a deadlock" $ do
    run <- simulate $ do
      target <- mask_ (start (Label "target" "") (uninterruptibleMask_ (atomically STM.retry)))
      sleep 1
      interrupt (threadId target) (Cancel "a") :: IO ()
    explain (outcome run) `shouldSatisfy` ("main waits for target to receive an exception" `isInfixOf`)
  it "does not outlive the run" $ do
    held <- newIORef ()
    weak <- mkWeakIORef held (pure ())
    run <- simulate $ do
      target <- mask_ (start (Label "target" "") (uninterruptibleMask_ (atomically STM.retry)))
      throwToAll (const (Holding held)) [threadId target]
      sleep 1 :: IO ()
      atomically STM.retry :: IO ()
    explain (outcome run) `shouldSatisfy` ("interrupt: helper waits for target to receive an exception" `isInfixOf`)
    performMajorGC
    (() <$) <$> deRefWeak weak `shouldReturn` Nothing
  it "has thrown nothing if the run ends and the remaining threads are unwound" $ do
    logged <- newIORef []
    _ <- simulate $ do
      target <- mask_ . start (Label "target" "") $ do
        end <- try (uninterruptibleMask_ (atomically STM.retry))
        either (\(_ :: SomeException) -> modifyIORef logged ("unwound" :)) (\() -> pure ()) end
      throwToAll (const (Cancel "a")) [threadId target]
      sleep 1
      atomically STM.retry :: IO ()
    readIORef logged `shouldReturn` ["unwound"]
 where
  shown = either (show :: SomeException -> String) (\() -> "returned")

endOfBranch :: Spec
endOfBranch = do
  it "is recorded with its start and its end, also if it is stopped before it begins" $
    void . explore (exhaustively 1) $ \simulated -> do
      run <- simulated (parallel (pure ()) (pure ()))
      [stepKind s | s <- steps run, stepLabel s == Label "parallel" "right", stepKind s `elem` [Starts, Ends]]
        `shouldBe` [Starts, Ends]
  it "can be stopped after its last operation" $ do
    ends <- everyEnd $ do
      target <- mask_ (start (Label "target" "") (sleep 1))
      sleep 1
      throwToAll (const (Cancel "a")) [threadId target]
      either (show :: SomeException -> String) (\() -> "returned") <$> atomically (threadEnd target)
    ends `shouldMatchList` [show "returned", show (show (Cancel "a"))]
  it "without operations can be stopped, too" $ do
    count <- newIORef (0 :: Int)
    ends <- everyEnd $ do
      target <- mask_ (start (Label "target" "") (modifyIORef count (+ 1)))
      throwToAll (const (Cancel "a")) [threadId target]
      earlier <- readIORef count
      end <- atomically (threadEnd target)
      later <- readIORef count
      pure (later > earlier, either (show :: SomeException -> String) (\() -> "returned") end)
    ends `shouldContain` [show (True, show (Cancel "a"))]

  it "that polls a sensor keeps the fault of an uninterruptible reading" $
    let stuck = uninterruptibleMask_ (sleep 2 >> throwIO (Fault "bug")) :: Behavior Bool
     in everyEnd (timeout 1 (Signal.waitUntil (Signal.polling 5 stuck)))
          `shouldReturn` ["it faulted: " ++ displayException (Fault "bug")]

newtype Holding = Holding (IORef ())

instance Show Holding where
  show _ = "Holding"

instance Exception Holding
