-- |
-- How fast the simulator is.
module Main (main) where

import Control.Concurrent (runInUnboundThread)
import Control.Concurrent.STM (check, newTVarIO, readTVar, writeTVar)
import Control.Monad (forM_, replicateM, void)
import Data.List (sort)
import Numeric (showFFloat)

import Behavior
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Time (atomically, checkpoint, now)

main :: IO ()
main = runInUnboundThread $ do
  perSecond "scheduling points, two threads that take turns" 1e6 $ do
    turn <- newTVarIO True
    let player mine = forM_ [1 .. 100000 :: Int] $ \_ ->
          atomically (readTVar turn >>= check . (== mine) >> writeTVar turn (not mine))
    points <$> simulateWith tireless (both (player True) (player False))
  perSecond "scheduling points, one thread that goes on" 1e6 $
    points <$> simulateWith tireless (forM_ [1 .. 1000000 :: Int] (const checkpoint))
  perSecond "scheduling points, random schedules of a small mission" 0 $
    sum <$> mapM (\seed -> points <$> simulateWith defaults {scheduled = Seeded seed} mission) [1 .. 5000]
  perSecond "random schedules of a small mission" 0 $
    length <$> mapM (\seed -> simulateWith defaults {scheduled = Seeded seed} mission) [1 .. 5000]
  day <- median <$> replicateM 5 (timed (simulate aDay))
  line "a simulated day: a sensor at 1 Hz, a thousand actions" (showFFloat (Just 3) day " s") "at most 0.5 s" (day <= 0.5)
 where
  tireless = defaults {standstill = maxBound}
  aDay = Signal.monitor ((< 0) <$> Signal.polling 1 (pure (1 :: Int))) (pure ()) (forM_ [1 .. 1000 :: Int] (const (sleep 86.4)))

-- | A battery that gets low twice, under a limit of time.
mission :: Behavior ()
mission = do
  battery <- newTVarIO (20 :: Int)
  let low = (< 10) <$> Signal.watching (readTVar battery)
      use n = atomically (readTVar battery >>= \b -> writeTVar battery (b - n))
      recharge = sleep 1 >> atomically (writeTVar battery 100)
  Signal.monitor low recharge (sleep 1 >> use 15 >> sleep 1) ||| sleep 10

-- | The median of five rounds.
perSecond :: String -> Double -> IO Int -> IO ()
perSecond name least act = do
  rate <- fmap median . replicateM 5 $ do
    begun <- now
    n <- act
    ended <- now
    pure (fromIntegral n / realToFrac (ended - begun))
  if least == 0
    then line name (million rate) "" True
    else line name (million rate) ("at least " ++ million least) (rate >= least)
 where
  million rate
    | rate < 1e5 = showFFloat (Just 0) rate " a second"
    | otherwise = showFFloat (Just 2) (rate / 1e6) " million a second"

timed :: IO a -> IO Double
timed act = do
  begun <- now
  void act
  ended <- now
  pure (realToFrac (ended - begun))

median :: [Double] -> Double
median these = sort these !! (length these `div` 2)

line :: String -> String -> String -> Bool -> IO ()
line name figure target met =
  putStrLn (column 56 name ++ column 26 figure ++ column 32 target ++ (if null target then "" else if met then "met" else "NOT MET"))
 where
  column n text = take (max n (length text + 1)) (text ++ repeat ' ')
