-- |
-- How fast the simulator is: one round, with a line for each figure. With @memory random@ or
-- @memory exhaustive@: how much memory the exploration of a million schedules takes.
module Main (main) where

import Control.Concurrent (runInUnboundThread)
import Control.Concurrent.STM (check, newTVarIO, readTVar, writeTVar)
import Control.Monad (forM_, void, when)
import Data.IORef (atomicModifyIORef', modifyIORef', newIORef, readIORef)
import GHC.Stats (gc, gcdetails_live_bytes, getRTSStats)
import System.Environment (getArgs)
import System.Exit (die)
import System.Mem (performMajorGC)

import Behavior
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Time (checkpoint)
import Measured

main :: IO ()
main = runInUnboundThread $ do
  arguments <- getArgs
  case arguments of
    [] -> speed
    ["memory", "random"] -> memory "random" (randomly most)
    ["memory", "exhaustive"] -> memory "exhaustive" (exhaustively 5) {planSearch = Exhaustive 5 most}
    _ -> die "usage: simulation [memory (random | exhaustive)]"
 where
  most = 1000000

speed :: IO ()
speed = do
  perSecond "scheduling points, two threads in turn" $ do
    turn <- newTVarIO True
    let player mine = forM_ [1 .. 100000 :: Int] $ \_ ->
          atomically (readTVar turn >>= check . (== mine) >> writeTVar turn (not mine))
    runPoints <$> simulateWith tireless (both (player True) (player False))
  perSecond "scheduling points, one thread" $
    runPoints <$> simulateWith tireless (forM_ [1 .. 1000000 :: Int] (const checkpoint))
  perSecond "scheduling points, random schedules" $
    sum <$> mapM (fmap runPoints . scheduledBy) [1 .. 5000]
  perSecond "random schedules of a small mission" $
    length <$> mapM scheduledBy [1 .. 5000]
  (_, day) <- timed (simulate aDay)
  line "a simulated day" day
 where
  tireless = defaultSimOptions {livelockLimit = maxBound}
  scheduledBy seed = simulateWith defaultSimOptions {scheduled = Seeded seed} mission
  aDay =
    Signal.monitor
      ((< 0) <$> Signal.polling 1 (pure (1 :: Int)))
      (pure ())
      (forM_ [1 .. 1000 :: Int] (const (sleep 86.4)))

-- | The live memory after 20,000 schedules and after 200,000, and the highest resident memory.
memory :: String -> Plan -> IO ()
memory name plan = do
  tried <- newIORef (0 :: Int)
  measured <- newIORef []
  void . explore plan $ \simulated -> do
    n <- atomicModifyIORef' tried (\n -> (n + 1, n))
    when (n `elem` [20000, 200000]) $ do
      performMajorGC
      live <- gcdetails_live_bytes . gc <$> getRTSStats
      modifyIORef' measured ((n, live) :)
    void (simulated (missionWith (Signal.debounce 0.5)))
  -- Printed at the end, because printing takes memory, too.
  readIORef measured >>= mapM_ (\(n, live) -> line (name ++ " schedules, live " ++ show n) (fromIntegral live))
  line (name ++ " schedules, resident") =<< peakResidentBytes

-- | A battery that becomes low twice, under a time limit.
mission :: Behavior ()
mission = missionWith id

-- | The same, with a filter on its signal.
missionWith :: (Signal.Signal Bool -> Signal.Signal Bool) -> Behavior ()
missionWith filtered = do
  battery <- newTVarIO (20 :: Int)
  let low = filtered ((< 10) <$> Signal.watching (readTVar battery))
      use n = atomically (readTVar battery >>= \b -> writeTVar battery (b - n))
      recharge = sleep 1 >> atomically (writeTVar battery 100)
  Signal.monitor low recharge (sleep 1 >> use 15 >> sleep 1) ||| sleep 10

-- | Prints how much of what the action counts it does per second.
perSecond :: String -> IO Int -> IO ()
perSecond name act = do
  (n, seconds) <- timed act
  line name (fromIntegral n / seconds)

-- | Gives also how many seconds it took.
timed :: IO a -> IO (a, Double)
timed act = do
  begun <- time
  a <- act
  ended <- time
  pure (a, (ended - begun) / 1e9)
