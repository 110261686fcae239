-- |
-- Messages whose handler is interrupted at any moment: each is committed exactly once, in order.
-- (It finds a broken function with two capabilities only: then an exception comes at any moment.)
module Messages (attack) where

import Control.Concurrent (forkIO, killThread, throwTo, yield)
import Control.Concurrent.STM
import Control.Exception (bracket, mask, try)
import Control.Monad (forever, void)
import Data.Foldable (for_)

import Attack
import Behavior
import Behavior.Message

attack :: IO ()
attack = do
  interrupted "handleNext" 1000000 (\inbox commit -> forever (handleNext inbox (pure . commit)))
  interrupted "onMessage" 100000 (\inbox commit -> onMessage inbox (pure . commit) (atomically retry))

interrupted :: String -> Int -> (Inbox Int -> (Int -> STM ()) -> Behavior ()) -> IO ()
interrupted name messages consuming = do
  next <- newTVarIO 1
  wrong <- newTVarIO Nothing
  let commit m = do
        n <- readTVar next
        if m == n then writeTVar next (n + 1) else writeTVar wrong (Just (n, m))
      restarting restore act = forever (void (try (restore act) :: IO (Either Boom ())))
  withInbox messages (\deliver -> pure () <$ for_ [1 .. messages] deliver) $ \inbox -> do
    consumer <- mask (\restore -> forkIO (restarting restore (consuming inbox commit)))
    bracket (forkIO (forever (throwTo consumer (Boom 0) >> yield))) killThread $ \_ ->
      atomically $ do
        done <- (> messages) <$> readTVar next
        failing <- (/= Nothing) <$> readTVar wrong
        check (done || failing)
    killThread consumer
  end <- readTVarIO wrong
  for_ end $ \(expected, got) ->
    broken (name ++ ": message " ++ show got ++ " was committed where " ++ show expected ++ " was expected")
