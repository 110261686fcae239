{-# LANGUAGE ScopedTypeVariables #-}

module Behavior.TimeSpec (spec) where

import Control.Concurrent (myThreadId)
import Control.Concurrent.Async (asyncThreadId)
import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
import Control.Exception
import Control.Monad (replicateM, void, when)
import Data.Foldable (for_)
import Data.IORef (newIORef, readIORef, writeIORef)
import Data.List (sort)
import qualified System.Timeout as System
import Test.Hspec
import Test.QuickCheck hiding (Failure, within)

import Behavior
import Behavior.Internal.Core.Seconds (duration, period)
import Behavior.Internal.Seam.Runtime (Label (..), sleepToSlot)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Sim (Outcome (..), Run (outcome), explain, explore, randomly, simulate)
import Behavior.Time
import Support

-- | Where real time passes here, it is never more than a few milliseconds, and no example
-- depends on how fast the machine is.
spec :: Spec
spec = guarded $ do
  describe "Seconds" lengths
  describe "now" $
    it "never goes backwards" $ do
      moments <- replicateM 1000 now
      moments `shouldBe` sort moments
  describe "sleep" sleeping
  describe "timeout" timeouts
  describe "timeoutAt" deadlines

-- | Runs it in a simulation, where no time passes before a behaviour has begun.
virtually :: Behavior a -> IO a
virtually act =
  simulate act >>= \run -> case outcome run of
    Returned a -> pure a
    Threw e -> throwIO e
    other -> fail (explain other)

infinite, notANumber :: Seconds
infinite = 1 / 0
notANumber = 0 / 0

lengths :: Spec
lengths = do
  it "are written, and shown, as decimal numbers" $ do
    show (0.05 :: Seconds) `shouldBe` "0.05"
    show (3600 :: Seconds) `shouldBe` "3600.0"
    show (Just (-0.5 :: Seconds)) `shouldBe` "Just (-0.5)"
    map show [5e-324, -5e-324 :: Seconds] `shouldBe` ["5.0e-324", "-5.0e-324"]

  it "have their parentheses where other numbers have them" $
    for_ [0 .. 11] $ \precedence -> for_ [0.5, -0.5] $ \s ->
      showsPrec precedence (realToFrac s :: Seconds) "" `shouldBe` showsPrec precedence (s :: Double) ""

  it "can be read as they are shown" $
    property $ \(x :: Double) -> let s = realToFrac x :: Seconds in read (show s) === s

  it "can be calculated with" $
    property $ \(x :: Double) (y :: Double) ->
      realToFrac (realToFrac x + realToFrac y * 2 :: Seconds) === x + y * 2

  it "must not be negative or NaN" $
    for_ [-1, -0.001, notANumber, -infinite] $ \s -> do
      sleep s `shouldThrow` isRefusal "sleep: a duration is zero or more seconds, not " s
      timeout s (pure ()) `shouldThrow` isRefusal "timeout: a duration is zero or more seconds, not " s
      duration "x" s `shouldThrow` isRefusal "x: a duration is zero or more seconds, not " s

  it "is any number where a point in time is required" $ do
    sleepUntil notANumber `shouldThrow` isRefusal "sleepUntil: a point in time is a number, not " notANumber
    sleepUntil (-infinite)
    timeoutAt notANumber (pure ()) `shouldThrow` isRefusal "timeoutAt: a point in time is a number, not " notANumber

  it "must be at least a microsecond where a period is required" $ do
    for_ [0, -1, notANumber, 5e-324, 0.0000009] $ \s ->
      period "x" s `shouldThrow` isRefusal "x: a period is at least 0.000001 seconds, not " s
    for_ [0.000001, 0.001, infinite] $ \s -> period "x" s `shouldReturn` s
 where
  isRefusal text s (ErrorCall message) = message == text ++ show s

sleeping :: Spec
sleeping = do
  it "returns at once for zero seconds, even under uninterruptibleMask" $
    uninterruptibleMask_ (sleep 0)

  for_
    [ ("for zero seconds", \_ -> sleep 0)
    , ("until a slot that begins now", \t -> void (sleepToSlot 1 t t))
    ]
    $ \(how, act) ->
      it (how ++ " does not let another thread run in between, in a simulation") $
        void . explore (randomly 100) $ \simulated -> do
          written <- newIORef ""
          found <- newIORef ""
          let left = now >>= \t -> writeIORef written "left" >> act t >> readIORef written >>= writeIORef found
          _ <- simulated (both left (writeIORef written "right"))
          readIORef found `shouldReturn` "left"

  it "takes at least the given time" $
    for_ [0.0001, 0.001, 0.003] $ \s -> do
      start <- now
      sleep s
      end <- now
      end - start `shouldSatisfy` (>= s)

  it "until a given time ends at that time, or at once when it is past" $ do
    moment <- (+ 0.002) <$> now
    sleepUntil moment
    now >>= (`shouldSatisfy` (>= moment))
    sleepUntil (moment - 1000)

  it "can be interrupted, however long it would take" $
    for_ [3600, 1.0e30, infinite] $ \s -> do
      withThread (sleep s) $ \sleeper -> do
        awaitIdle (asyncThreadId sleeper)
        throwTo (asyncThreadId sleeper) (Cancel "the sleeper")
        awaitEnd sleeper `shouldReturn` CancelledBy (show (Cancel "the sleeper"))

timeouts :: Spec
timeouts = do
  it "changes nothing for a behaviour that is in time" $
    property $ \a ->
      sameAs (\entries -> timeout 3600 (play entries a)) (`play` a)
        .&&. sameAs (\entries -> timeout infinite (play entries a)) (`play` a)

  it "fails with TimedOut, which can be caught by ?, when the behaviour takes longer" $ do
    timeout 0.001 hang `shouldThrow` (== TimedOut 0.001)
    (timeout 0.001 hang ? pure 'b') `shouldReturn` 'b'
    displayException (TimedOut 0.5) `shouldBe` "timed out after 0.5 s"

  it "does not start the behaviour when there is no time at all" $
    observing (\entries -> timeout 0 (note entries 'a'))
      `shouldReturn` (FailedWith (show (TimedOut 0)), "")

  it "does not start the behaviour when there is no time at all, under any schedule"
    . void . explore (randomly 100) $ \simulated -> do
      entries <- newLog
      _ <- simulated (timeout 0 (note entries 'a'))
      notes entries `shouldReturn` ""

  it "returns when the behaviour has ended, however slow its cleanup" $ do
    (end, done) <- observing $ \entries ->
      virtually $ do
        ended <- try (timeout 1 (uninterruptibly (sleep 3600) (sleep 5 >> note entries "cleaned up")))
        (,) (ended :: Either TimedOut ()) <$> now
    (end, done) `shouldBe` (Gave (Left (TimedOut 1), 6), ["cleaned up"])

  it "keeps a result that the behaviour returns although its stop was requested" $
    virtually (timeout 1 ((sleep 3600 >> pure 'b') `catch` \(_ :: SomeAsyncException) -> pure 'a')) `shouldReturn` 'a'

  it "throws a failure or a fault of the cleanup instead of its own failure" $ do
    virtually (timeout 1 (sleep 3600 `onException` failWith "cleanup" :: IO ()))
      `shouldThrow` (== FailedBecause "cleanup")
    virtually (timeout 1 (sleep 3600 `onException` throwIO (Fault "cleanup") :: IO ()))
      `shouldThrow` (== Fault "cleanup")

  it "makes no second stop request when it is cancelled after the time was up" $
    observing
      ( \entries ->
          virtually (timeout 3 (timeout 1 (sleep 3600 `onException` (sleep 5 >> note entries "cleaned up"))))
      )
      `shouldReturn` (FailedWith (show (TimedOut 3)) :: Ending (), ["cleaned up"])

  it "is distinguished from the timeouts around and inside it" $ do
    timeout 3600 (timeout 0.001 hang) `shouldThrow` (== TimedOut 0.001)
    timeout 0.001 (timeout 3600 hang) `shouldThrow` (== TimedOut 0.001)
    timeout 3600 (timeout 0.001 hang ? pure 'b') `shouldReturn` 'b'
    -- The outer one's time is up: the inner one's alternative does not run.
    timeout 0.001 (timeout 3600 hang ? pure 'b') `shouldThrow` (== TimedOut 0.001)
    System.timeout 1000 (timeout 3600 hang ? pure 'b') `shouldReturn` Nothing
    timeout 0.001 (System.timeout 3600000000 hang) `shouldThrow` (== TimedOut 0.001)

  it "measures its time from when it is run, each time" $ do
    let limited = timeout 0.001
    virtually ((limited hang ? pure ()) >> limited (pure 'a')) `shouldReturn` 'a'

  it "measures its time from the call, however late its clock starts" $
    eventually $ do
      begun <- now
      let timeIsUp = (>= begun + 0.02) <$> now
          startingLate event = when (event == Started (Label "timeout" "clock")) (eventually timeIsUp)
      watchingThreads startingLate (timeout 0.02 hang) `shouldThrow` (== TimedOut 0.02)
      ended <- now
      -- (If the machine was too slow, the result means nothing: then try again.)
      pure (ended < begun + 0.04)

  it "makes what its behaviour has written visible when it returns" $ do
    var <- newTVarIO 'a'
    timeout 3600 (atomically (writeTVar var 'b'))
    atomically (readTVar var) `shouldReturn` 'b'

  it "labels its two threads, the branch and the clock" $ do
    (_, events) <- observing $ \entries -> watchingThreads (note entries) (timeout 3600 (pure ()))
    [started | Started started <- events]
      `shouldMatchList` [Label "timeout" "branch", Label "timeout" "clock"]

  it "runs the behaviour in a thread of its own" $ do
    caller <- myThreadId
    timeout 3600 myThreadId >>= (`shouldNotBe` caller)

deadlines :: Spec
deadlines = do
  it "is timeout with the time that is left" $
    for_ [-1, 0, 2.5, 4, infinite] $ \end -> for_ [0, 2.5, 3] $ \begin -> do
      let at limited = virtually $ do
            sleep begin
            how <- try (limited (sleep 2 >> pure 'a'))
            (,) (how :: Either TimedOut Char) <$> now
      one <- at (timeoutAt end)
      other <- at (\act -> now >>= \t -> timeout (max 0 (end - t)) act)
      (end, begin, one) `shouldBe` (end, begin, other)

  it "does not start the behaviour when the deadline has passed" . void . explore (randomly 100) $ \simulated -> do
    entries <- newLog
    _ <- simulated (now >>= \end -> sleep 1 >> for_ [end, end + 1] (\e -> timeoutAt e (note entries 'a') ? pure ()))
    notes entries `shouldReturn` ""

  it "is kept by a mission that a monitor interrupts and that tries again after pauses, under random schedules"
    . void . explore (randomly 300) $ \simulated -> do
      low <- newTVarIO False
      events <- newLog
      let record what = now >>= \t -> note events (what, t)
          charge = record "charge" >> sleep 10 >> atomically (writeTVar low False)
          oneTry = record "try" >> sleep 100
          drains = for_ [7, 40] (\t -> sleepUntil t >> atomically (writeTVar low True)) >> sleepForever
          mission = do
            end <- (+ 60) <$> now
            Signal.monitor (Signal.watching (readTVar low)) charge
              (timeoutAt end (retrying (iterate (* 2) 1) (timeout 5 oneTry)))
      _ <- simulated ((drains ||| mission) `fallbackWith` (record . show))
      -- 5 s for each try, pauses of 1, 2, 4 and 8 s; after each charging from the beginning.
      notes events
        `shouldReturn` [ ("try", 0), ("try", 6), ("charge", 7), ("try", 17), ("try", 23), ("try", 30)
                       , ("try", 39), ("charge", 40), ("try", 50), ("try", 56), ("TimedOut 10.0", 60)
                       ]

  it "does not start a task again whose deadline passed while the robot recovered" $ do
    low <- newTVarIO True
    entries <- newLog
    let charge = sleep 10 >> atomically (writeTVar low False)
    virtually (Signal.monitor (Signal.watching (readTVar low)) charge (timeoutAt 5 (note entries "task")))
      `shouldThrow` (== TimedOut 0)
    notes entries `shouldReturn` []
