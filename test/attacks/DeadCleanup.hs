-- | A cleanup blocks for ever while its operator waits for it. Expected: GHC detects the
-- deadlock and wakes the cleanup, as it does without the library.
module DeadCleanup (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM_, void, when)
import System.Mem (performMajorGC)

import Attack
import Behavior

attack :: IO ()
attack =
  forM_ [(way, collecting) | way <- ways, collecting <- [True, False]] $ \((name, operator), collecting) -> do
    woken <- newEmptyMVar
    -- (No reference to the caller's thread is kept.)
    _ <- forkIO (operator (dead woken))
    awaiting (200 :: Int) woken collecting (name ++ if collecting then ", with collections" else ", idle")
 where
  ways =
    [ ("without the library", \cleanup -> do
        done <- newEmptyMVar
        _ <- forkIO (cleanup `finally` putMVar done ())
        uninterruptibleMask_ (again (takeMVar done)))
    , ("with it", operating id)
    , ("with it, masked", operating mask_)
    ]
  operating :: (IO () -> IO ()) -> IO () -> IO ()
  operating around cleanup =
    void (try (around act) :: IO (Either SomeException ()))
   where
    act = parallel (milliseconds 3600000 `finally` cleanup) (milliseconds 20)
  again act = act `catch` \BlockedIndefinitelyOnMVar -> again act
  awaiting n woken collecting name = do
    done <- tryTakeMVar woken
    case done of
      Just () -> pure ()
      Nothing
        | n == 0 -> broken ("GHC did not wake the cleanup, " ++ name)
        | otherwise -> do
            when collecting performMajorGC
            if collecting then milliseconds 20 else milliseconds 500
            awaiting (n - if collecting then 1 else 10) woken collecting name
  dead woken = do
    box <- newEmptyMVar :: IO (MVar ())
    takeMVar box `catch` \BlockedIndefinitelyOnMVar -> putMVar woken ()
