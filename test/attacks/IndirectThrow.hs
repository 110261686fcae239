-- | A cleanup throws to the operator's caller from a branch or a thread of its own, and
-- waits for that. It hangs, since the caller has been stopped already or is masked.
module IndirectThrow (attack) where

import Control.Concurrent
import qualified Control.Concurrent.Async as Async
import Control.Exception
import Control.Monad (forM_, void)
import Data.List (intercalate)

import Attack
import Behavior
import Behavior.Parallel (allOf, scoped, fork)
import qualified Behavior.Parallel as P
import Behavior.STM (atomically)

attack :: IO ()
attack = do
  hung <- newMVar []
  forM_ ways $ \(name, indirectly) ->
    forM_ callers $ \(caller, around) -> do
      entered <- newEmptyMVar
      over <- newEmptyMVar
      t <- mask_ $ forkIOWithUnmask $ \unmask -> void . flip finally (putMVar over ()) $ do
        me <- myThreadId
        try (unmask $ do
          let act = (putMVar entered () >> milliseconds 3600000) `finally` indirectly (throwTo me (Boom 1))
          _ <- around (parallel act (milliseconds 100))
          milliseconds 300) :: IO (Either SomeException ())
      takeMVar entered
      milliseconds 20
      _ <- forkIO (throwTo t (Boom 0))
      milliseconds 1500
      ended <- tryTakeMVar over
      case ended of
        Just () -> pure ()
        Nothing -> modifyMVar_ hung (pure . ((name ++ ", " ++ caller) :))
  those <- takeMVar hung
  promise ("these hang: " ++ intercalate "; " (reverse those)) (null those)

ways :: [(String, IO () -> IO ())]
ways =
  [ ("directly", id)
  , ("in both", \act -> both act (pure ()))
  , ("in allOf", \act -> void (allOf [act, pure ()]))
  , ("in monitor", monitor (pure False) (pure ()))
  , ("in a child that is awaited", \act -> scoped (\n -> fork n act >>= \c -> atomically (P.await c)))
  , ("in async's concurrently", \act -> Async.concurrently_ act (pure ()))
  ]

callers :: [(String, IO () -> IO ())]
callers =
  [ ("a caller that was interrupted before", id)
  , ("a masked caller", mask_)
  ]
