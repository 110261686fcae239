{-# LANGUAGE LambdaCase #-}

-- |
-- 'Signal.polling': which readings wake an operator. A reading that is equal to the last one
-- wakes no thread; apart from that the suppression is not observable.
module Behavior.EqualitySuppressionSpec (spec) where

import Control.Concurrent (myThreadId)
import Control.Concurrent.Async (asyncThreadId)
import Control.Exception
import Data.Foldable (for_)
import Data.IORef
import Data.List (sort)
import System.IO.Unsafe (unsafePerformIO)
import Test.Hspec hiding (after, before)
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck (Property, choose, forAll, ioProperty, listOf1, (===))

import Behavior (Behavior, Seconds, both, sleep)
import Behavior.Internal.Seam.Runtime (now)
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Sim
  ( SimOptions (..)
  , Outcome (OutOfTime, Returned, Threw)
  , Run (..)
  , defaultSimOptions
  , explain
  , simulateWith
  )
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "A reading equal to the last one" equalReadings
  describe "A reading that differs" differentReadings
  describe "Equality suppression is not observable" unobservable
  describe "staleAfter, while no value changes," stale

-- | Runs it for at most a minute of simulated time, and returns how and when it ended.
minute :: Behavior a -> IO (String, Seconds)
minute act = do
  run <- simulateWith defaultSimOptions {endAt = 60} act
  pure (shown (outcome run), finished run)
 where
  shown = \case
    Returned _ -> "over"
    OutOfTime _ -> "goes on"
    Threw e -> show e
    other -> explain other

-- | A sensor that reads the time, every second.
time :: Signal Seconds
time = Signal.polling 1 now

equalReadings :: Spec
equalReadings = do
  for_ operators $ \op ->
    it ("does not wake " ++ show op) $ do
      readers <- newIORef []
      entered <- newGate
      level <- newSensor pure
      let positive n = unsafePerformIO $ do
            self <- myThreadId
            (n > 0) <$ atomicModifyIORef' readers (\others -> (self : others, ()))
          main = open entered >> hang
      withThread (running op (positive <$> sensing level) main hang) $ \caller -> do
        let wakeups = length . filter (== asyncThreadId caller) <$> readIORef readers
        pass entered
        awaitIdle (asyncThreadId caller)
        readingsBeyond 3 level
        before <- wakeups
        readingsBeyond 20 level
        wakeups `shouldReturn` before

  it "is not suppressed where a new reading is required: after a switch it decides" $ do
    entries <- newLog
    let branch isOver = now >>= note entries . (,) isOver >> if isOver then pure () else hang
    minute (Signal.switch ((>= 5) <$> time) branch) `shouldReturn` ("over", 6)
    notes entries `shouldReturn` [(False, 0), (True, 6)]

  for_ [(0.2, 6.5), (0.7, 7.5)] $ \(cleanup, decided) ->
    it ("decides only if it began after the switch, when that takes " ++ show cleanup ++ " s") $ do
      -- Readings take half a second; the first that differs ends at 5.5.
      let signal = Signal.polling 1 ((< 5) <$> now <* sleep 0.5)
      minute (Signal.rSelect signal (uninterruptibly hang (sleep cleanup)) (pure ()))
        `shouldReturn` ("over", decided)

  it "decides after a recovery" $ do
    entries <- newLog
    let recovery = now >>= note entries >> sleep 3
    _ <- minute (Signal.monitor ((\t -> t >= 5 && t < 10) <$> time) recovery hang)
    notes entries `shouldReturn` [5, 8]

differentReadings :: Spec
differentReadings = do
  for_ operators $ \op ->
    it ("wakes " ++ show op ++ " at once") $ do
      entries <- newLog
      let main = hang `onException` (now >>= note entries)
      _ <- minute (running op ((\t -> t < 5 || t >= 6) <$> time) main (pure "other"))
      take 1 <$> notes entries `shouldReturn` [5]

  for_ [("faults", toException (Fault "level")), ("fails", toException (Failure "level"))] $ \(manner, e) -> do
    it ("and that " ++ manner ++ " when it is compared is not lost") $
      minute (Signal.switch (Incomparable e <$> time) (const hang)) `shouldReturn` (show e, 5)

    it ("and that " ++ manner ++ " when it is compared, of a debounced signal, is not lost") $
      minute (Signal.switch (Signal.debounce 1 (Incomparable e <$> time)) (const hang)) `shouldReturn` (show e, 5)

    it ("and to which a function is applied that " ++ manner ++ " is not lost") $
      minute (Signal.rSelect ((\t -> t < 5 || throw e) <$> time) hang hang) `shouldReturn` (show e, 5)

  it "and cannot be compared takes precedence over one to its right, when both are found at once" $ do
    let left = toException (Fault "left")
        incomparable e = Signal.debounce 1 (Incomparable e <$> time)
        pair = (,) <$> incomparable left <*> incomparable (toException (Fault "right"))
    minute (Signal.withShared pair (\s -> sleep 10 >> Signal.switch s (const hang))) `shouldReturn` (show left, 10)

-- | Cannot be compared from second 5 on.
data Incomparable = Incomparable SomeException Seconds

instance Eq Incomparable where
  Incomparable e s == Incomparable _ t = max s t < 5 || throw e

unobservable :: Spec
unobservable = do
  prop "on a polled signal" $ sameAsUnsuppressed id
  prop "on a debounced one, also if it changes to an equal value" $ sameAsUnsuppressed (Signal.debounce 2.5)
  prop "on one with hysteresis" $ sameAsUnsuppressed (fmap fromEnum . Signal.hysteresis False 3 6)

  it "by two operators on a shared signal: each receives the changes of its own view" $ do
    entries <- newLog
    let following n s = Signal.switch ((`div` n) . floor <$> s) $ \k ->
          now >>= \t -> note entries (n, k, t) >> hang
        body s = sleep 0.5 >> both (following 2 s) (following (3 :: Int) s) :: Behavior ()
    _ <- simulateWith defaultSimOptions {endAt = 8.5} (Signal.withShared time body)
    -- Every second reading, or every third, is a change; the next reading decides.
    sort <$> notes entries
      `shouldReturn` [(2, 0, 1), (2, 1, 3), (2, 2, 5), (2, 3, 7), (3, 0, 1), (3, 1, 4), (3, 2, 7)]

-- | For all readings, and however coarse the view of them, the signal behaves as one that
-- publishes each reading. (A signal of several sources does so.)
sameAsUnsuppressed :: (Signal Int -> Signal Int) -> Property
sameAsUnsuppressed refined =
  forAll ((,) <$> choose (1, 4) <*> listOf1 (choose (0, 9))) $ \(coarseness, levels) ->
    ioProperty $ do
      let level = (\t -> cycle levels !! floor t) <$> now
          coarse = (`div` coarseness) <$> refined (Signal.polling 1 level)
          history signal = do
            entries <- newLog
            _ <- minute (Signal.switch signal (\k -> now >>= note entries . (,) k >> hang))
            notes entries
      (===) <$> history coarse <*> history (const <$> coarse <*> pure ())

stale :: Spec
stale = do
  it "fails when a reading hangs" $
    minute (Signal.waitUntil (Signal.staleAfter 2 hanging)) `shouldReturn` (tooLong, 7)

  it "has no effect while readings are in time" $
    minute (Signal.waitUntil (Signal.staleAfter 2 (Signal.polling 5 (False <$ sleep 1.5))))
      `shouldReturn` ("goes on", 60)

  for_ ways $ \(way, made) ->
    it ("fails when a reading hangs " ++ way) $
      minute (Signal.waitUntil (Signal.staleAfter 2 (made hanging))) `shouldReturn` (tooLong, 7)

  for_ [(3, 7), (6, 7), (8, 8)] $ \(used, failedAt) ->
    it ("fails on a shared signal when a reading hangs from second 5 on, and it is used from second "
        ++ show used ++ " on") $
      minute (Signal.withShared hanging (\s -> sleep used >> Signal.waitUntil (Signal.staleAfter 2 s)))
        `shouldReturn` (tooLong, failedAt)
 where
  hanging = Signal.polling 1 (now >>= \t -> if t < 5 then pure False else hang)
  tooLong = "FailedBecause \"no reading of the signal within 2.0 s\""
  ways =
    [ ("under a function", fmap (&& True))
    , ("under debounce", Signal.debounce 0.1)
    , ("under hysteresis", Signal.hysteresis False False True)
    , ("on the left of one that needs no readings", \s -> (||) <$> s <*> unread)
    , ("on the right of one that needs no readings", \s -> (||) <$> unread <*> s)
    , ("on the left of one that is read in time", \s -> (||) <$> s <*> inTime)
    , ("on the right of one that is read in time", \s -> (||) <$> inTime <*> s)
    ]
  unread = Signal.watching (pure False)
  inTime = Signal.polling 1 (False <$ sleep 0.5)
