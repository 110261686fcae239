-- | A cleanup throws to the operator's caller, which is masked uninterruptibly. It hangs, as
-- in GHC.
module UninterruptibleCaller (attack) where

import Control.Concurrent
import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
import Control.Exception
import Control.Monad (forM_, void)
import System.IO (hFlush, stdout)

import Attack
import Behavior
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Time (timeout)

attack :: IO ()
attack =
  forM_ operators $ \(name, operator) ->
    forM_ [("uninterruptible", uninterruptibleMask_)] $ \(caller, around) -> do
      putStrLn (name ++ ", " ++ caller) >> hFlush stdout
      flag <- newTVarIO True
      entered <- newEmptyMVar
      _ <- forkIO (takeMVar entered >> milliseconds 5 >> atomically (writeTVar flag False))
      _ <- inThread 3000 (name ++ ", " ++ caller) $ do
        me <- myThreadId
        let act = (putMVar entered () >> milliseconds 3600000) `finally` throwTo me (Boom 1)
        (around :: IO () -> IO ()) (operator (Signal.watching (readTVar flag)) act)
        milliseconds 500
      n <- liveThreadCount
      promise (show n ++ " threads were left") (n == 0)

operators :: [(String, Signal.Signal Bool -> IO () -> IO ())]
operators =
  [ ("parallel", \c act -> parallel act (Signal.waitUntil (not <$> c)))
  , ("whileHolding", \c act -> Signal.whileHolding c act ? pure ())
  , ("rSelect", \c act -> Signal.rSelect c act (pure ()))
  , ("switch", \c act -> Signal.switch c (\k -> if k then act else pure ()))
  , ("monitor", \c act -> Signal.monitor (not <$> c) failed act ? pure ())
  , ("timeout", \_ act -> void (timeout 0.05 act) ? pure ())
  ]
