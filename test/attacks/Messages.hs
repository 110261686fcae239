-- |
-- Messages whose handler is interrupted at any moment: each is committed exactly once, in order; as one of ordered
-- rules too, beneath a rule whose condition changes all the time, and by several robots that share an inbox; no handler
-- begins without need.
-- (It finds a broken function with two capabilities only: then an exception comes at any moment.)
module Messages (attack) where

import Control.Concurrent (forkIO, killThread, throwTo, yield)
import Control.Concurrent.STM
import Control.Exception (bracket, mask, try)
import Control.Monad (forever, replicateM_, void, when)
import Data.Foldable (for_)
import Data.IORef
import qualified Data.IntSet as IntSet

import Attack
import Behavior
import Behavior.Message
import qualified Behavior.Signal as Signal

attack :: IO ()
attack = do
  interrupted "handleNext" 1000000 (\inbox commit -> forever (handleNext inbox (pure . commit)))
  interrupted "onMessage" 100000 (\inbox commit -> onMessage inbox (pure . commit) (atomically retry))
  interrupted "messageRule" 100000 $ \inbox commit -> do
    rule <- messageRule inbox (pure . commit)
    Signal.teleoReactive [rule, (pure True, atomically retry)]
  mapM_ (outranked 30000) [1, 3]

-- | Robots that share an inbox, each with a rule for danger before its rule for messages.
outranked :: Int -> Int -> IO ()
outranked messages robots = do
  committed <- newTVarIO IntSet.empty
  twice <- newTVarIO Nothing
  begun <- newIORef (0 :: Int)
  dangers <- newIORef (0 :: Int)
  let commit m = do
        done <- readTVar committed
        if IntSet.member m done then writeTVar twice (Just m) else writeTVar committed (IntSet.insert m done)
      robot inbox = do
        danger <- newTVarIO False
        fleeing <- newTVarIO False
        rule <- messageRule inbox (\m -> add begun >> replicateM_ 3 yield >> pure (commit m))
        let flee = forever (atomically (readTVar fleeing >>= check . not >> writeTVar fleeing True))
            -- (With two capabilities nine yields can be too short for a handler to begin, again and again.)
            alarms = forever . for_ (1000 : replicate 300 9) $ \pauses -> do
              add dangers
              atomically (writeTVar danger True)
              atomically (readTVar fleeing >>= check >> writeTVar fleeing False >> writeTVar danger False)
              replicateM_ pauses yield
        alarms ||| Signal.teleoReactive [(Signal.watching (readTVar danger), flee), rule, (pure True, atomically retry)]
  withInbox messages (\deliver -> pure () <$ for_ [1 .. messages] deliver) $ \inbox ->
    foldr both (pure ()) (replicate robots (robot inbox)) ||| atomically (unhandled inbox >>= check . (== 0))
  done <- IntSet.size <$> readTVarIO committed
  again <- readTVarIO twice
  for_ again $ \m -> broken ("message " ++ show m ++ " was committed twice")
  when (done /= messages) . broken $ show done ++ " of " ++ show messages ++ " messages were committed"
  starts <- readIORef begun
  interruptions <- readIORef dangers
  when (starts > messages + interruptions) . broken $
    show starts ++ " handlers began, for " ++ show interruptions ++ " interruptions"
  putStrLn
    ( show robots ++ " robots: " ++ show starts ++ " handlers began for " ++ show messages ++ " messages and "
        ++ show interruptions ++ " dangers"
    )
 where
  add counter = atomicModifyIORef' counter (\n -> (n + 1, ()))

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
