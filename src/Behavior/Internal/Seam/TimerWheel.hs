{-# OPTIONS_HADDOCK not-home #-}

-- |
-- A timer wheel: wakes many threads at given times, without a timer of the system for each.
--
-- All sleepers that are due in the same tick share a bucket, an 'MVar'; a timer fills the
-- buckets that are due. To sleep and be woken costs a lookup and an 'MVar'; to cancel a sleep
-- costs nothing, because it unregisters nothing.
--
-- A cancelled sleeper leaves an entry in the bucket's queue until the bucket is filled.
-- Therefore a thread waits only at a bucket that is at most one second away, or at most as far
-- as it has slept so far, if that is longer. So the entry of a cancelled short sleep is gone within
-- a second, and that of a long one within the time that it had slept.
--
-- (A process made by @forkProcess@ while another thread slept has a copy of the armed timers,
-- but not the threads that run them: nothing wakes there.)
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Seam.TimerWheel
  ( sleepBetween
  , sleepToSlot
  , slotTime
  , nextBucket
  ) where

import Control.Concurrent (forkIO, myThreadId, rtsSupportsBoundThreads, threadDelay, yield)
import Control.Concurrent.MVar
import Control.Exception (mask_)
import Control.Monad (void, when)
import Data.Foldable (toList, traverse_)
import Data.IORef (IORef, atomicModifyIORef', newIORef, readIORef)
import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import Data.List (delete)
import Foreign.C (CInt (..), CUInt (..))
import GHC.Clock (getMonotonicTime)
import GHC.Conc (labelThread)
import System.IO.Unsafe (unsafePerformIO)

-- | The state of the timer wheel of this process.
data Wheel = Wheel
  { buckets :: !(IntMap (MVar ()))
  -- ^ One for each tick in which a sleeper is due. It is filled once.
  , armedTimers :: ![Tick]
  -- ^ When the armed timers expire, the earliest first. An armed timer is never cancelled: for a
  -- sleeper that is due earlier another one is armed.
  }

wheel :: IORef Wheel
wheel = unsafePerformIO (newIORef (Wheel IntMap.empty []))
{-# NOINLINE wheel #-}

-- | Sleeps until the second time. The first is now. (Both are times of 'getMonotonicTime'.)
sleepBetween :: Double -> Double -> IO ()
sleepBetween from to = when (to > from) $ sleepTicks (tick floor from) (tick ceiling (min to (forever from)))

-- | Sleeps from now until the beginning of a slot, in a sequence of slots of the given period,
-- and gives the time of that beginning.
sleepToSlot :: Double -> Double -> Double -> IO Double
sleepToSlot period from to = slot <$ sleepBetween from slot
 where
  slot = slotTime period from to

-- | When the slot begins that is due at the third time: up to a tenth of the period later, so
-- that all sleepers with the same period are woken together, at most ten times in a period.
--
-- (A slot's beginning is counted in tenths of the period since time zero, and not from the slot
-- before: so rounding errors do not add up.)
slotTime :: Double -> Double -> Double -> Double
slotTime period from to
  | to > from && to < forever from && tenth > epsilon = tenth * fromIntegral (ceiling ((to - epsilon) / tenth) :: Int)
  | otherwise = to
 where
  tenth = period / 10
  epsilon = 1e-6

sleepTicks :: Tick -> Tick -> IO ()
sleepTicks from end = go from
 where
  go t = do
    let next = nextBucket from end t
    bucketAt next >>= readMVar
    when (next < end) $ go next

-- | The tick of the bucket to wait at next. The arguments are the ticks at which the sleep began, at which it is
-- to end, and until which it has lasted.
nextBucket :: Tick -> Tick -> Tick -> Tick
nextBucket from end t = t + min (end - t) (max ticksPerSecond (t - from))

-- | About a century from now. It stands for an infinite time, and can be counted in ticks.
forever :: Double -> Double
forever from = from + 3e9

-- | A moment, counted in eighths of a millisecond: finer than the resolution of GHC's timers.
type Tick = Int

tick :: (Double -> Tick) -> Double -> Tick
tick rounded seconds = rounded (seconds * fromIntegral ticksPerSecond)

ticksPerSecond :: Tick
ticksPerSecond = 8000

-- | The bucket of the tick.
bucketAt :: Tick -> IO (MVar ())
bucketAt t = readIORef wheel >>= maybe (newBucket t) pure . IntMap.lookup t . buckets

newBucket :: Tick -> IO (MVar ())
newBucket t = mask_ $ do
  new <- newEmptyMVar
  (bucket, needsTimer) <- atomicModifyIORef' wheel $ \known ->
    case IntMap.lookup t (buckets known) of
      Just old -> (known, (old, False))
      Nothing
        | t `isBeforeAll` armedTimers known -> (Wheel others (t : armedTimers known), (new, True))
        | otherwise -> (known {buckets = others}, (new, False))
       where
        others = IntMap.insert t new (buckets known)
  when needsTimer . void . forkIO $ do
    self <- myThreadId
    labelThread self "timer"
    runTimer t t
  pure bucket

isBeforeAll :: Tick -> [Tick] -> Bool
isBeforeAll t = all (t <) . take 1

-- | Expires at the tick, or not before the second one if that is a little later. Then the timer
-- is armed for the next bucket, unless another timer expires before.
runTimer :: Tick -> Tick -> IO ()
runTimer t later = do
  getMonotonicTime >>= delay
  current <- tick floor <$> getMonotonicTime
  (due, next) <- atomicModifyIORef' wheel (expire current)
  traverse_ (`putMVar` ()) due
  -- The woken threads run first: if they sleep again before this thread does, the system does
  -- not have to wake a thread for them.
  yield
  -- (Not by 'Data.Foldable.for_', which would return here: this thread's stack would grow.)
  maybe (pure ()) (\t' -> runTimer t' (max t' (current + minTimerGap))) next
 where
  delay now = when (left > 0) $ sleepFor left >> getMonotonicTime >>= delay
   where
    left = fromIntegral later / fromIntegral ticksPerSecond - now
  expire current known = (Wheel future (maybe others (: others) next), (IntMap.elems past ++ toList now, next))
   where
    (past, now, future) = IntMap.splitLookup current (buckets known)
    others = delete t (armedTimers known)
    next = IntMap.lookupMin future >>= \(at, _) -> if at `isBeforeAll` others then Just at else Nothing

-- | The shortest time between two expirations of a timer; sleepers due in between are woken
-- together.
minTimerGap :: Tick
minTimerGap = 6

-- | Sleeps for about the given number of seconds. Below 50 ms by the system's sleep, which is
-- more exact than GHC's, and costs less to start. (It occupies a thread of the system; with the
-- non-threaded runtime there is only one, so there GHC's is used.)
sleepFor :: Double -> IO ()
sleepFor seconds
  | not rtsSupportsBoundThreads = threadDelay (microseconds (min aDay seconds))
  | seconds < 0.05 = void (usleep (microseconds seconds))
  | otherwise = threadDelay (microseconds (min aDay seconds - 0.025))
 where
  microseconds :: Integral n => Double -> n
  microseconds = ceiling . (* 1000000)
  aDay = 86400

foreign import ccall safe "usleep" usleep :: CUInt -> IO CInt
