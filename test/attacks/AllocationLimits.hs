-- |
-- GHC's limits of what a thread may allocate ('enableAllocationLimit'), which throw at a random moment, in the
-- caller of operators, in their branches and in their sensors. Expected: the operator throws 'AllocationLimitExceeded'
-- (for a sensor or a branch too: nothing takes it for a failure), and nothing is left.
module AllocationLimits (attack) where

import Control.Exception
import Control.Monad (forM_, forever, replicateM_, void)
import Data.IORef
import Data.Int (Int64)
import System.Mem (disableAllocationLimit, enableAllocationLimit, setAllocationCounter)

import Attack
import Behavior
import Behavior.Parallel (allOf, fork, scoped)
import qualified Behavior.Signal as Signal
import qualified Behavior.Time as Time

attack :: IO ()
attack = forM_ [1 .. 1500 :: Int] $ \k -> forM_ places $ \(place, program) -> do
  inside <- newIORef (0 :: Int)
  let act = bracket_ (add inside 1) (add inside (-1)) (Time.sleep 3600)
      what = "allocation limit in " ++ place ++ ", " ++ show k
  -- (The factor spreads the limits; they are the same in every run.)
  end <- inThread 5000 what (program (fromIntegral (k * 13 `mod` 20000)) act `finally` disableAllocationLimit)
  n <- readIORef inside
  promise (what ++ ": " ++ show n ++ " behaviours still run") (n == 0)
  left <- liveThreadCount
  promise (what ++ ": " ++ show left ++ " threads were left") (left == 0)
  promise (what ++ ": " ++ show end) (either (\e -> show e == show AllocationLimitExceeded) (const False) end)
 where
  add r n = atomicModifyIORef' r (\x -> (x + n, ()))

places :: [(String, Int64 -> IO () -> IO ())]
places =
  [ ("the caller", \n act -> limited n >> forever (Time.timeout 0.001 (nest act) ? pure ()))
  , ("a branch", \n act -> both act (Signal.whileHolding (pure True) (parallel act (using n))) ? pure ())
  , ("a forked child", \n act -> scoped (\nursery -> fork nursery (using n) >> act) ? pure ())
  , ("a sensor", \n act -> monitor (False <$ using n) act act ? pure ())
  , ("a recovery", \n act -> both act (Signal.monitor (pure True) (using n) act) ? pure ())
  ]
 where
  nest act = Signal.monitor (pure False) failed (both act (void (allOf [act, act])))
  limited n = setAllocationCounter n >> enableAllocationLimit
  using n = do
    limited n
    kept <- newIORef []
    forever (replicateM_ 100 (modifyIORef' kept (() :)) >> writeIORef kept [])
