{-# LANGUAGE LambdaCase #-}

-- |
-- 'Signal.polling': which readings an operator hears of. One that is like the last one
-- wakes nobody; and apart from that nobody can tell.
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
import Behavior.Internal.Runtime (now)
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Sim (Options (..), Outcome (OutOfTime, Returned), Run (..), defaults, explain, simulateWith)
import qualified Behavior.Sim as Sim
import Support
import Watched

spec :: Spec
spec = guarded $ do
  describe "A reading like the last one" unheard
  describe "A reading that differs" heard
  describe "What is no news is no other behaviour:" unnoticed
  describe "staleAfter, though nothing changes," stale

-- | Runs it for a minute at most, all of it simulated, and says how and when that ended.
minute :: Behavior a -> IO (String, Seconds)
minute act = do
  run <- simulateWith defaults {endAt = 60} act
  pure (told (outcome run), finished run)
 where
  told = \case
    Returned _ -> "over"
    OutOfTime -> "goes on"
    Sim.Failing e -> show e
    Sim.Faulting e -> show e
    other -> explain other

-- | A sensor that shows the time, every second.
time :: Signal Seconds
time = Signal.polling 1 now

unheard :: Spec
unheard = do
  -- (Of several sources each reading is news, and rules have several.)
  for_ [op | op <- operators, operator op /= "teleoReactive"] $ \op ->
    it ("does not wake " ++ show op) $ do
      lookers <- newIORef []
      entered <- newGate
      level <- newSensor pure
      let positive n = unsafePerformIO $ do
            self <- myThreadId
            (n > 0) <$ atomicModifyIORef' lookers (\others -> (self : others, ()))
          main = open entered >> hang
      launching (running op (positive <$> sensing level) main hang) $ \caller -> do
        let awoken = length . filter (== asyncThreadId caller) <$> readIORef lookers
        pass entered
        awaitIdle (asyncThreadId caller)
        readingsBeyond 3 level
        before <- awoken
        readingsBeyond 20 level
        awoken `shouldReturn` before

  it "is heard by who asks for one: after a switch it decides" $ do
    book <- newLog
    let branch isOver = now >>= note book . (,) isOver >> if isOver then pure () else hang
    minute (Signal.switch ((>= 5) <$> time) branch) `shouldReturn` ("over", 6)
    notes book `shouldReturn` [(False, 0), (True, 6)]

  for_ [(0.2, 6.5), (0.7, 7.5)] $ \(cleanup, decided) ->
    it ("decides only if it began after that, when the switch takes " ++ show cleanup ++ " s") $ do
      -- Readings take half a second; the first that differs ends at 5.5.
      let signal = Signal.polling 1 ((< 5) <$> now <* sleep 0.5)
      minute (Signal.rSelect signal (uninterruptibly hang (sleep cleanup)) (pure ()))
        `shouldReturn` ("over", decided)

  it "decides after a recovery" $ do
    book <- newLog
    let recovery = now >>= note book >> sleep 3
    _ <- minute (Signal.monitor ((\t -> t >= 5 && t < 10) <$> time) recovery hang)
    notes book `shouldReturn` [5, 8]

heard :: Spec
heard = do
  for_ operators $ \op ->
    it ("wakes " ++ show op ++ " at once") $ do
      book <- newLog
      let main = hang `onException` (now >>= note book)
      _ <- minute (running op ((\t -> t < 5 || t >= 6) <$> time) main (pure "other"))
      take 1 <$> notes book `shouldReturn` [5]

  for_ [("faults", toException (Fault "level")), ("fails", toException (Failure "level"))] $ \(manner, e) -> do
    it ("it is a reading that " ++ manner ++ " when it is compared, which is not lost") $
      minute (Signal.switch (Incomparable e <$> time) (const hang)) `shouldReturn` (show e, 5)

    it ("it is one of a debounced signal that " ++ manner ++ " when it is compared, which is not lost") $
      minute (Signal.switch (Signal.debounce 1 (Incomparable e <$> time)) (const hang)) `shouldReturn` (show e, 5)

    it ("it is a reading of which the function " ++ manner ++ ", which is not lost") $
      minute (Signal.rSelect ((\t -> t < 5 || throw e) <$> time) hang hang) `shouldReturn` (show e, 5)

  it "of two readings that cannot be compared the left one counts, when both are found at once" $ do
    let left = toException (Fault "left")
        incomparable e = Signal.debounce 1 (Incomparable e <$> time)
        both' = (,) <$> incomparable left <*> incomparable (toException (Fault "right"))
    minute (Signal.withShared both' (\s -> sleep 10 >> Signal.switch s (const hang))) `shouldReturn` (show left, 10)

-- | From five on it cannot be compared.
data Incomparable = Incomparable SomeException Seconds

instance Eq Incomparable where
  Incomparable e s == Incomparable _ t = max s t < 5 || throw e

unnoticed :: Spec
unnoticed = do
  prop "of a polled signal" $ sameAsUnheard id
  prop "of a debounced one, also if it changes to what looks the same" $ sameAsUnheard (Signal.debounce 2.5)
  prop "of one with hysteresis" $ sameAsUnheard (fmap fromEnum . Signal.hysteresis False 3 6)

  it "two operators on a shared signal each hear of what is news to them" $ do
    book <- newLog
    let following n s = Signal.switch ((`div` n) . floor <$> s) $ \k ->
          now >>= \t -> note book (n, k, t) >> hang
        body s = sleep 0.5 >> both (following 2 s) (following (3 :: Int) s) :: Behavior ()
    _ <- simulateWith defaults {endAt = 8.5} (Signal.withShared time body)
    -- A change is seen at the even ones, or at each third; the next reading decides.
    sort <$> notes book
      `shouldReturn` [(2, 0, 1), (2, 1, 3), (2, 2, 5), (2, 3, 7), (3, 0, 1), (3, 1, 4), (3, 2, 7)]

-- | For all readings, and however coarsely one looks at them, the signal is the same as
-- one that has to tell of each reading. (One of several sources has to.)
sameAsUnheard :: (Signal Int -> Signal Int) -> Property
sameAsUnheard refined =
  forAll ((,) <$> choose (1, 4) <*> listOf1 (choose (0, 9))) $ \(coarseness, levels) ->
    ioProperty $ do
      let level = (\t -> cycle levels !! floor t) <$> now
          coarse = (`div` coarseness) <$> refined (Signal.polling 1 level)
          course signal = do
            book <- newLog
            _ <- minute (Signal.switch signal (\k -> now >>= note book . (,) k >> hang))
            notes book
      (===) <$> course coarse <*> course (const <$> coarse <*> pure ())

stale :: Spec
stale = do
  it "hears of a reading that hangs" $
    minute (Signal.waitUntil (Signal.staleAfter 2 hanging)) `shouldReturn` (tooLong, 7)

  it "lets pass readings that are in time" $
    minute (Signal.waitUntil (Signal.staleAfter 2 (Signal.polling 5 (False <$ sleep 1.5))))
      `shouldReturn` ("goes on", 60)

  for_ ways $ \(way, made) ->
    it ("fails when a reading hangs " ++ way) $
      minute (Signal.waitUntil (Signal.staleAfter 2 (made hanging))) `shouldReturn` (tooLong, 7)

  for_ [(3, 7), (6, 7), (8, 8)] $ \(asked, noticed') ->
    it ("hears of it on a shared signal, when it hangs since 5 and is asked about at " ++ show asked) $
      minute (Signal.withShared hanging (\s -> sleep asked >> Signal.waitUntil (Signal.staleAfter 2 s)))
        `shouldReturn` (tooLong, noticed')
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
