{-# LANGUAGE LambdaCase #-}

-- |
-- An operator does not deadlock with a cleanup that throws to the operator's caller, once.
-- (A second exception, or one for a caller that was stopped already or is masked, is pending
-- until the operator ends: a cleanup has to throw it in a thread of its own.) And two time
-- limits that expire meanwhile behave as in plain GHC.
module Behavior.ThrowingCleanupSpec (spec) where

import Control.Concurrent (ThreadId, forkIO, killThread, myThreadId)
import Control.Concurrent.Async (asyncThreadId)
import Control.Concurrent.STM (newTVarIO, readTVar, readTVarIO, writeTVar)
import Control.Exception
import Control.Monad (replicateM_, void)
import Data.Foldable (for_)
import GHC.Conc (BlockReason (..), ThreadStatus (..), threadStatus)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Internal.Seam.Runtime (atomically)
import Behavior.Parallel (allOf, firstOf, scoped)
import qualified Behavior.Signal as Signal
import Behavior.Time (timeout)
import Support hiding (End (..))

spec :: Spec
spec = guarded $ do
  describe "A cleanup that throws to the operator's caller" fromCleanups
  describe "An operator that waits for a cleanup" twoExceptions
  describe "A branch that is uninterruptible when its stop is requested" uninterruptibleBranch
  describe "Two limits that expire while an operator waits for a cleanup" limits

-- | Each operator, with a branch that runs on, and an action whose end makes the operator
-- stop that branch.
operators, forTwo :: [(String, Behavior () -> Behavior () -> Behavior ())]
forTwo =
  [ ("parallel", flip parallel)
  , ("parallel, left", parallel)
  , ("both", \act enough -> both act (enough >> failed))
  , ("allOf", \act enough -> void (allOf [act, enough >> failed]))
  ]
operators =
  forTwo
    ++ [ ("firstOf", \act enough -> firstOf [enough, act, hang])
       , ("scoped", \act enough -> scoped (\_ -> parallel act enough))
       , ("whileHolding", \act enough -> condition enough (`Signal.whileHolding` act))
       , ("monitor", \act enough -> condition enough (\c -> Signal.monitor (not <$> c) (pure ()) act))
       , ("monitor in parallel", \act enough -> monitor (pure False) (pure ()) act ||| enough)
       , ("withShared in timeout", \act enough -> timeout 3600 (Signal.withShared (pure ()) (const act) ||| enough))
       ]
 where
  -- A signal that is true until the action ends.
  condition enough body = do
    over <- newTVarIO False
    body (not <$> Signal.watching (readTVar over)) ||| (enough >> atomically (writeTVar over True) >> hang)

fromCleanups :: Spec
fromCleanups = do
  for_ operators $ \(name, operator) ->
    for_ masks $ \(manner, masked) -> do
      it (name ++ ", " ++ manner ++ ": the operator ends, and throws that exception") $
        stopping operator (masked . eStop) `shouldReturn` FaultedWith (show (Fault "e-stop"))
      it (name ++ ", " ++ manner ++ ", and again by a thread of its own: \
         \the operator ends, and throws the first exception") $
        stopping operator (\me -> masked (eStop me >> void (forkIO (throwTo me (Cancel "again")))))
          `shouldReturn` FaultedWith (show (Fault "e-stop"))
      it (name ++ ", " ++ manner ++ ", by a thread of its own, when the caller was cancelled: \
         \the operator ends as cancelled") $ do
        entered <- newGate
        let stopsItself = do me <- myThreadId; operator (branch entered (masked (void (forkIO (eStop me))))) hang
        end <- withThread stopsItself $ \caller -> do
          pass entered
          throwing (asyncThreadId caller) (Cancel "the caller")
          awaitEnd caller
        end `shouldBe` CancelledBy (show (Cancel "the caller"))

  it "in nested operators, many of them, by threads of their own: all end, and no branch is left" $
    replicateM_ 20 $ do
      gates <- mapM (const newGate) [1 .. 4 :: Int]
      occupancy <- newTVarIO (0 :: Int)
      end <- withThread (do
        me <- myThreadId
        let throwAside target e = void (forkIO (throwTo target (Fault e)))
            one n cleanup = counted occupancy (branch (gates !! n) cleanup)
            nested n m = do
              self <- myThreadId
              parallel (one n (throwAside self "inner")) (one m (throwAside me "outer"))
        parallel (for_ gates pass) (both (nested 0 1) (nested 2 3))) awaitEnd
      end `shouldSatisfy` \case
        Gave () -> True
        FaultedWith _ -> True
        CancelledWithFault _ _ -> True
        _ -> False
      readTVarIO occupancy `shouldReturn` 0
 where
  masks =
    [ ("masked", id)
    , ("uninterruptibly", uninterruptibleMask_)
    ] :: [(String, IO () -> IO ())]
  eStop me = throwTo me (Fault "e-stop")
  branch entered cleanup = (open entered >> hang) `onException` cleanup
  stopping operator cleanup = do
    entered <- newGate
    withThread (myThreadId >>= \me -> operator (branch entered (cleanup me)) (pass entered)) awaitEnd
  counted occupancy act =
    mask $ \restore -> do
      atomically (readTVar occupancy >>= writeTVar occupancy . (+ 1))
      restore act `finally` uninterruptibleMask_ (atomically (readTVar occupancy >>= writeTVar occupancy . subtract 1))

-- | They come when the operator itself has requested the stop, and was not interrupted before.
twoExceptions :: Spec
twoExceptions =
  for_ operators $ \(name, operator) ->
    it (name ++ ": ends after it, though two exceptions are thrown at its caller") $ do
      entries <- newLog
      entered <- newGate
      cleaning <- newGate
      release <- newGate
      let branch = uninterruptibly (open entered >> hang) $ do
            open cleaning
            pass release
            note entries "branch is over"
      withThread (operator branch (pass entered) `onException` note entries "operator is over") $ \caller -> do
        pass cleaning
        for_ ["first", "second"] $ \which -> do
          throwing (asyncThreadId caller) (Cancel which)
          stillRunning caller
        open release
        awaitEnd caller `shouldReturn` CancelledBy (show (Cancel "first"))
      notes entries `shouldReturn` ["branch is over", "operator is over"]

-- | The operator requests the stop, and is interrupted before the branch has received it.
uninterruptibleBranch :: Spec
uninterruptibleBranch =
  for_ forTwo $ \(name, operator) ->
    it (name ++ ": receives the request, though the caller was interrupted meanwhile") $ do
      entered <- newGate
      mayStop <- newGate
      end <- withThread (operator (uninterruptibleMask_ (open entered >> pass mayStop) >> hang) (pass entered)) $
        \caller -> do
          eventually ((== ThreadBlocked BlockedOnException) <$> threadStatus (asyncThreadId caller))
          throwing (asyncThreadId caller) (Cancel "the caller")
          open mayStop
          awaitEnd caller
      end `shouldBe` CancelledBy (show (Cancel "the caller"))

-- | They behave as around an action that GHC itself cannot interrupt.
limits :: Spec
limits =
  for_ [("the inner one first", False), ("the outer one first", True)] $ \(order, outerFirst) -> do
    for_ operators $ \(name, operator) ->
      it (name ++ ", " ++ order ++ ": the outer one ends it, and neither is received after it") $ do
        entered <- newGate
        mayEnd <- newGate
        stopping <- newGate
        expired outerFirst stopping mayEnd $
          operator ((open entered >> hang) `uninterruptibly` (open stopping >> pass mayEnd)) (pass entered)
    it ("an action that GHC cannot interrupt, " ++ order
        ++ ": the outer one ends it, and neither is received after it") $ do
      mayEnd <- newGate
      stopping <- newGate
      expired outerFirst stopping mayEnd (uninterruptibleMask_ (open stopping >> pass mayEnd))

expired :: Bool -> Gate -> Gate -> IO () -> IO ()
expired outerFirst stopping mayEnd act = do
  inner <- newLimit
  outer <- newLimit
  later <- newGate
  entries <- newLog
  let caller = do
        result <- limited outer (limited inner act >>= \r -> note entries "between" >> pure r)
        open later
        mapM_ (\_ -> pass later) [1 .. 100 :: Int]
        pure result
  end <- withThread caller $ \running -> do
    pass stopping
    for_ (if outerFirst then [outer, inner] else [inner, outer]) expire
    open mayEnd
    awaitEnd running
  end `shouldBe` Gave Nothing
  notes entries `shouldReturn` []

-- | A limit like 'System.Timeout.timeout', but one that expires when the test triggers it,
-- not by the clock.
data Limit = Limit Gate (Gate, ThreadIdBox)

type ThreadIdBox = Log ThreadId

newLimit :: IO Limit
newLimit = (\trigger set box -> Limit trigger (set, box)) <$> newGate <*> newGate <*> newLog

newtype Expired = Expired ThreadId
  deriving (Eq, Show)

instance Exception Expired where
  toException = asyncExceptionToException
  fromException = asyncExceptionFromException

limited :: Limit -> IO a -> IO (Maybe a)
limited (Limit trigger (set, box)) act = do
  me <- myThreadId
  own <- newTVarIO Nothing
  let start = do
        thrower <- forkIO (pass trigger >> myThreadId >>= throwTo me . Expired)
        atomically (writeTVar own (Just thrower))
        note box thrower
        thrower <$ open set
  handleOwn
    own
    (bracket start (uninterruptibleMask_ . killThread) (const (Just <$> act)))
 where
  handleOwn own body =
    body `catch` \(Expired thrower) ->
      readTVarIO own >>= \mine -> if mine == Just thrower then pure Nothing else throwIO (Expired thrower)

-- | Makes the limit expire. Returns when its exception was received, or is pending.
expire :: Limit -> IO ()
expire (Limit trigger (set, box)) = do
  pass set
  open trigger
  notes box >>= mapM_ awaitThrown
