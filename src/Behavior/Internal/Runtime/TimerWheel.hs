{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Waking at a given time, for many sleepers and without a timer for each.
--
-- Who sleeps waits at a gate, with all others who want to wake in the same tick; a clock
-- opens the gates that are due. To lie down and to be woken costs what a lookup and an
-- 'MVar' cost, and to be interrupted costs nothing: there is nothing to take back.
--
-- Who is interrupted leaves a place in the gate's queue until it opens. Therefore nobody
-- waits at a gate that is farther away than he has slept already, or than a second: what is
-- left of a short sleep is gone within a second, and of a long one within its length.
--
-- (A process that was made by @forkProcess@ while another thread slept has that one's
-- clock, but nobody who keeps it: there nothing wakes.)
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Runtime.TimerWheel
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

-- | All that sleeps in this process.
data Alarms = Alarms
  { buckets :: !(IntMap (MVar ()))
  -- ^ One for each tick in which somebody wants to wake. It is opened once.
  , armedTimers :: ![Tick]
  -- ^ When the clocks go off, the earliest first. One that is set is never stopped: when
  -- somebody wants to wake earlier, another is set.
  }

alarms :: IORef Alarms
alarms = unsafePerformIO (newIORef (Alarms IntMap.empty []))
{-# NOINLINE alarms #-}

-- | Sleeps from now, as 'getMonotonicTime' tells it, until it tells the second time or a
-- later one.
sleepBetween :: Double -> Double -> IO ()
sleepBetween from to = when (to > from) $ sleepTicks (tick floor from) (tick ceiling (min to (forever from)))

-- | Sleeps from now until the beginning of a slot, for who does that in every period, and
-- gives the time of it.
sleepToSlot :: Double -> Double -> Double -> IO Double
sleepToSlot period from to = slot <$ sleepBetween from slot
 where
  slot = slotTime period from to

-- | When the slot begins that was asked for: up to a tenth of the period later, so that all
-- who have the same period wake together, ten times in a period at most.
--
-- (A slot is counted in tenths since the clock's beginning, and not from the slot before:
-- what is rounded does not add up.)
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

-- | Where to wait next, having slept until the third, when it is to be from the first until
-- the second.
nextBucket :: Tick -> Tick -> Tick -> Tick
nextBucket from end t = t + min (end - t) (max ticksPerSecond (t - from))

-- | A century from now is as good as for ever, and can be counted.
forever :: Double -> Double
forever from = from + 3e9

-- | A moment, counted in eighths of a millisecond: finer than GHC's clocks can tell.
type Tick = Int

tick :: (Double -> Tick) -> Double -> Tick
tick rounded seconds = rounded (seconds * fromIntegral ticksPerSecond)

ticksPerSecond :: Tick
ticksPerSecond = 8000

-- | The gate that opens at the tick.
bucketAt :: Tick -> IO (MVar ())
bucketAt t = readIORef alarms >>= maybe (newBucket t) pure . IntMap.lookup t . buckets

newBucket :: Tick -> IO (MVar ())
newBucket t = mask_ $ do
  new <- newEmptyMVar
  (bucket, unclocked) <- atomicModifyIORef' alarms $ \known ->
    case IntMap.lookup t (buckets known) of
      Just old -> (known, (old, False))
      Nothing
        | t `isBeforeAll` armedTimers known -> (Alarms others (t : armedTimers known), (new, True))
        | otherwise -> (known {buckets = others}, (new, False))
       where
        others = IntMap.insert t new (buckets known)
  when unclocked . void . forkIO $ do
    self <- myThreadId
    labelThread self "clock"
    clock t t
  pure bucket

isBeforeAll :: Tick -> [Tick] -> Bool
isBeforeAll t = all (t <) . take 1

-- | Goes off at the tick, or a little later as the second one says. Then it is set for the
-- next gate, unless another goes off before.
clock :: Tick -> Tick -> IO ()
clock t later = do
  getMonotonicTime >>= delay
  current <- tick floor <$> getMonotonicTime
  (due, next) <- atomicModifyIORef' alarms (expire current)
  traverse_ (`putMVar` ()) due
  -- First those who were woken: if they have gone to sleep again when this thread does,
  -- the system has no thread to wake for them.
  yield
  -- (Not by 'Data.Foldable.for_', which would come back: the clock's stack would grow.)
  maybe (pure ()) (\t' -> clock t' (max t' (current + minTimerGap))) next
 where
  delay now = when (left > 0) $ sleepFor left >> getMonotonicTime >>= delay
   where
    left = fromIntegral later / fromIntegral ticksPerSecond - now
  expire current known = (Alarms future (maybe others (: others) next), (IntMap.elems past ++ toList now, next))
   where
    (past, now, future) = IntMap.splitLookup current (buckets known)
    others = delete t (armedTimers known)
    next = IntMap.lookupMin future >>= \(at, _) -> if at `isBeforeAll` others then Just at else Nothing

-- | How long a clock rests at least, for all who want to wake meanwhile.
minTimerGap :: Tick
minTimerGap = 6

-- | Sleeps for about so many seconds; the last stretch by the system's sleep, which is more
-- exact than GHC's, and not so dear to set. (It keeps a thread of the system busy, and
-- where there is only one, that must not be.)
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
