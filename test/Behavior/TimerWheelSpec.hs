-- |
-- The timer wheel: sleeping until a given time, by many threads.
--
-- A little real time passes here; only lower bounds of it are tested, and that each sleep
-- ends.
module Behavior.TimerWheelSpec (spec) where

import Control.Concurrent (myThreadId, yield)
import Control.Concurrent.Async
import Control.Exception (mask_)
import Control.Monad (replicateM, replicateM_, void, when)
import Data.Foldable (for_)
import Data.List (nub)
import GHC.Clock (getMonotonicTime)
import System.CPUTime (getCPUTime)
import Test.Hspec
import Test.Hspec.QuickCheck (modifyMaxSuccess, prop)
import Test.QuickCheck hiding (within)

import Behavior.Internal.Seam.TimerWheel
import Memory
import Support

spec :: Spec
spec = guarded $ do
  describe "A slot" slots
  describe "A sleep" sleeps
  describe "Many sleeps" many

-- | The consecutive slots, from the given one on, of a thread that is late by the given
-- part of a period each time, which is still in time for the next slot.
slotsOf :: Double -> Double -> Double -> [Double]
slotsOf period late = iterate $ \slot -> slotTime period (slot + late * period) (slot + period)

slots :: Spec
slots = do
  for_ [0.1, 0.01, 0.001, 1 / 30, 1 / 3, 0.0123, 0.07, 0.25, 1, 7.3] $ \period ->
    it ("keeps a period of " ++ show period ++ " s, to the millisecond, for an hour") $ do
      let first = slotTime period 4711.1234567 (4711.1234567 + period)
          due = [first + fromIntegral k * period | k <- [0 :: Int .. ceiling (3600 / period)]]
      take 1 [(slot, time) | (slot, time) <- zip (slotsOf period 0.01 first) due, abs (slot - time) > 0.001]
        `shouldBe` []

  prop "keeps any period, to the microsecond, for a thousand of them" $
    forAll ((,,) <$> periods <*> choose (0, 0.99) <*> times) $ \(period, late, t) ->
      let first = slotTime period t (t + period)
          drift = slotsOf period late first !! 1000 - (first + 1000 * period)
       in counterexample (show drift) $ abs drift < 1e-6

  prop "begins at the requested time, or at most a tenth of the period later" $
    forAll ((,,) <$> periods <*> choose (0, 1) <*> times) $ \(period, ahead, t) ->
      let to = t + ahead * period
          slot = slotTime period t to
       in -- (A microsecond is less than a wakeup takes.)
          counterexample (show (slot - to)) $ slot >= to - 1e-6 && slot <= to + max 0.000125 (period / 10)

  prop "is one of ten in a period, for all periods that are round numbers" $
    forAll ((,) <$> elements roundOnes <*> vectorOf 1000 times) $ \(period, ts) ->
      let phase t = round (slotTime period t (t + period) * 8000) `mod` (round (period * 8000) :: Int)
       in length (nub (map phase ts)) <= 10

  it "that has begun already is not awaited" $
    slotTime 0.1 5.01 5.003 `shouldBe` 5.003
 where
  roundOnes = [0.005, 0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1, 7.3]
  periods = oneof [choose (0.001, 10), elements roundOnes]
  times = choose (0, 1000000)

sleeps :: Spec
sleeps = do
  modifyMaxSuccess (const 5) . prop "ends, and never before its time, among many others" $
    forAll (vectorOf 500 (choose (0, 0.02))) $ \seconds ->
      ioProperty $ do
        early <- forConcurrently seconds $ \s -> do
          t <- getMonotonicTime
          sleepBetween t (t + s)
          subtract (t + s) <$> getMonotonicTime
        pure (filter (< 0) early === [])

  modifyMaxSuccess (const 5) . prop "until a slot ends, and never before the slot begins" $
    forAll (vectorOf 100 (choose (0.001, 0.02))) $ \periods ->
      ioProperty $ do
        early <- forConcurrently periods $ \period -> do
          t <- getMonotonicTime
          slot <- sleepToSlot period t (t + period)
          subtract slot <$> getMonotonicTime
        pure (filter (< 0) early === [])

  it "until a slot gives the time at which the slot begins, and not the one that was requested" $ do
    t <- getMonotonicTime
    sleepToSlot 0.01 t (t + 0.003) `shouldReturn` slotTime 0.01 t (t + 0.003)

  it "for more than a second does not end after one" $ do
    t <- getMonotonicTime
    -- (As if the sleep had begun earlier: the second is over soon.)
    sleepBetween (t - 0.999) (t + 0.05)
    getMonotonicTime >>= (`shouldSatisfy` (>= t + 0.05))

  it "for less than a twentieth of a second uses almost no processor time" $ do
    costs <- replicateM 5 $ do
      begun <- getCPUTime
      t <- getMonotonicTime
      sleepBetween t (t + 0.04)
      subtract begun <$> getCPUTime
    let picosecondsInAMillisecond = 1000000000
    minimum costs `shouldSatisfy` (< 5 * picosecondsInAMillisecond)

  it "until an earlier time than all others ends before them" $
    replicateM_ 3 . eventually $ do
      -- (If the machine was too slow, the result means nothing: then try again.)
      t <- getMonotonicTime
      withThread (sleepBetween t (t + 0.1)) $ \other -> do
        awaitIdle (asyncThreadId other)
        t' <- getMonotonicTime
        sleepBetween t' (t' + 0.001)
        woken <- getMonotonicTime
        awaitEnd other `shouldReturn` Gave ()
        pure (woken < t + 0.1)

  it "can be interrupted: it ends at once, and other sleeps until the same time still end" $ do
    t <- getMonotonicTime
    let to = t + 0.05
    sleeping <- replicateM 5 (async (sleepBetween t to >> getMonotonicTime))
    for_ sleeping (awaitIdle . asyncThreadId)
    let (interrupted, others) = splitAt 3 sleeping
    for_ interrupted cancel
    for_ others $ \other -> do
      woken <- wait other
      woken `shouldSatisfy` (>= to)

  it "for ever can be interrupted" $ do
    t <- getMonotonicTime
    for_ [sleepBetween t (1 / 0), void (sleepToSlot (1 / 0) t (1 / 0))] $ \act ->
      withThread act $ \sleeper -> do
        awaitIdle (asyncThreadId sleeper)
        stillRunning sleeper
        cancel sleeper

  it "for ever does not end, however long ago it began" $ do
    t <- getMonotonicTime
    let aYearAgo = t - 3e7
    withThread (sleepBetween aYearAgo (1 / 0)) $ \sleeper -> do
      awaitIdle (asyncThreadId sleeper)
      -- This one has waited in the same buckets, all of which have expired by now, and in
      -- its own.
      sleepBetween aYearAgo t
      stillRunning sleeper

  for_ [0, -1, -1 / 0] $ \seconds ->
    it ("for " ++ show seconds ++ " s does not block, so that nothing can interrupt it") $ do
      entries <- newLog
      let act = mask_ $ do
            self <- myThreadId
            throwing self (Cancel "the sleeper")
            t <- getMonotonicTime
            sleepBetween t (t + seconds)
            _ <- sleepToSlot 0.01 t (t + seconds)
            note entries "went on"
      _ <- withThread act awaitEnd
      notes entries `shouldReturn` ["went on"]

many :: Spec
many = do
  it "all end, however many begin and end" $ do
    lengths <- generate (vectorOf 1000 (vectorOf 20 (choose (0, 0.002))))
    forConcurrently_ lengths . mapM_ $ \s ->
      getMonotonicTime >>= \t -> sleepBetween t (t + s)

  it "all end when others until the same times are interrupted" $ do
    lengths <- generate (vectorOf 200 (vectorOf 10 (choose (0, 0.002))))
    (`mapConcurrently_` lengths) . mapM_ $ \s -> do
      t <- getMonotonicTime
      withThread (sleepBetween t (t + s)) $ \_ -> sleepBetween t (t + s / 2)
      sleepBetween t (t + s)

  it "all end when others are interrupted just as they begin" $
    for_ [1 .. 300 :: Int] $ \n -> do
      t <- getMonotonicTime
      for_ [1 .. 10] $ \k ->
        withThread (sleepBetween t (t + 0.002 - k / 8000)) $ \_ ->
          replicateM_ (n `mod` 7) yield
      when (n `mod` 10 == 0) $ sleepBetween t (t + 0.003)

  -- (Until any time in the next tenth of a second a thread sleeps, and a garbage collection is shorter: one armed
  -- timer expires again and again. A stack grows by 32 kB at a time, which is some two thousand calls. The steps after
  -- the last measurement are there so that the timer has not ended. On another capability a thread's stack may be deep
  -- each time that it is measured.)
  it "use an armed timer that needs no more memory the longer it is in use" . onOneCapability $
    growingByLessThan 20000 3000 $ \step -> do
      begun <- getMonotonicTime
      forConcurrently_ [1 .. 125] $ \k ->
        for_ [0 .. 24] $ \n -> do
          now <- getMonotonicTime
          sleepBetween now (begun + n / 10 + k / 1250) >> step

  it "use one armed timer, however many begin and end during another long one" $
    growingByLessThan 20000 400 $ \step -> do
      begun <- getMonotonicTime
      withThread (sleepBetween begun (1 / 0)) $ \_ ->
        replicateM_ 400 $ do
          t <- getMonotonicTime
          sleepBetween t (t + 0.0005) >> step

  -- (An interrupted sleep leaves memory in use until its bucket expires.)
  prop "never wait in a bucket that is further away than they have lasted, or than a second" $
    forAll ((,) <$> choose (0, maxBound `div` 4) <*> oneof [choose (1, 100000), choose (1, maxBound `div` 4)]) $
      \(from, long) ->
        let end = from + long
            buckets = takeWhile (< end) (take 100 (iterate (nextBucket from end) from)) ++ [end]
            far = [bucket - t | (t, bucket) <- zip buckets (drop 1 buckets), bucket - t > max second (t - from)]
         in counterexample (show buckets) $ far === [] .&&. length buckets < 64
 where
  second = 8000
