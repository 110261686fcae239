-- | Random trees of operators: several exceptions are thrown to the caller at random moments,
-- and cleanups fault. Expected: each ends, nothing is left, no fault or cancellation is lost.
module Storm (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM_, replicateM_, void, when)
import Data.IORef
import System.Timeout (timeout)

import Attack
import Behavior
import Behavior.Parallel (allOf, firstOf, fork, requestStop, scoped)
import qualified Behavior.Signal as Signal
import qualified Behavior.Time as Time

attack :: IO ()
attack = do
  below <- randomBelow 12345
  forM_ [1 .. 3000 :: Int] $ \k -> do
    inside <- newIORef (0 :: Int)
    faulted <- newIORef (0 :: Int)
    let leaf = do
          kind <- below 6
          fault <- (== 0) <$> below 8
          d <- below 600
          pure $ mask $ \restore -> do
            add inside 1
            r <- try (restore (case kind of
              0 -> threadDelay d
              1 -> failed
              2 -> threadDelay d >> failed
              _ -> milliseconds 3600000)) :: IO (Either SomeException ())
            when (kind == 3) (uninterruptibleMask_ (threadDelay d))
            add inside (-1)
            when (fault && either (const True) (const False) r) (add faulted 1 >> throwIO (Boom k))
            either throwIO pure r
        tree :: Int -> IO (IO ())
        tree 0 = leaf
        tree n = do
          a <- tree (n - 1)
          b <- tree (n - 1)
          which <- below 11
          pure $ case which of
            0 -> parallel a b
            1 -> both a b
            2 -> a ? b
            3 -> firstOf [a, b]
            4 -> void (allOf [a, b])
            5 -> scoped (\nursery -> fork nursery a >>= \c -> b `finally` requestStop c)
            6 -> Signal.monitor (pure False) a b
            7 -> monitor (pure False) a b
            8 -> void (Time.timeout 0.0003 a) ? b
            9 -> Signal.withShared (Signal.polling 0.001 (pure True)) (`Signal.whileHolding` parallel a b)
            _ -> mask_ (parallel a b)
    behavior <- below 4 >>= tree
    waits <- mapM (\_ -> below 800) [1 .. 3 :: Int]
    inner <- below 900
    finished <- newIORef (0 :: Int)
    let exception i = if even (k + i) then toException (Boom (-i)) else toException ThreadKilled
        throwing t = forM_ (zip [1 ..] waits) $ \(i, w) -> forkIO (threadDelay w >> throwTo t (exception i))
    end <- endsWithin 20000 ("storm " ++ show k) throwing $ do
      r <- try (timeout inner behavior) :: IO (Either SomeException (Maybe ()))
      uninterruptibleMask_ $ do
        n <- readIORef inside
        when (n /= 0) (void (broken ("storm " ++ show k ++ ": " ++ show n ++ " behaviours still run")))
        f <- readIORef faulted
        -- (A second fault may be hidden by the first.)
        when (f > 0 && not (faultIn k r)) (void (broken ("storm " ++ show k ++ ": a fault was lost: " ++ show r)))
      writeIORef finished 1
    end `seq` pure ()
    left <- liveThreadCount
    promise ("storm " ++ show k ++ ": " ++ show left ++ " threads were left") (left == 0)
    replicateM_ 1 (threadDelay 100)
 where
  add r n = atomicModifyIORef' r (\x -> (x + n, ()))
  faultIn k r = case r of
    Left e -> mentions k e
    Right _ -> False
  mentions k e = case (fromException e, fromException e) of
    (Just (Boom n), _) -> n == k
    (_, Just (StoppedWithFault cause fault)) -> mentions k cause || mentions k fault
    _ -> False
