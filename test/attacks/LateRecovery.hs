-- | Attacks: the task ends just when the condition becomes true, and the sensor is deaf for 4 s. Must
-- come out: the recovery begins at once, and does not wait until the sensor has been stopped.
module LateRecovery (attack) where

import Control.Concurrent
import Control.Concurrent.STM (atomically, check, newTVarIO, readTVar, writeTVar)
import Control.Exception
import Control.Monad (forM, unless, when)
import Data.IORef
import Data.Maybe (catMaybes, isNothing)
import System.Environment (getExecutablePath, lookupEnv)
import System.Posix.Process (executeFile)

import Attack
import Behavior hiding (monitor)
import Behavior.Signal (monitor, polling, watching)

-- | The moment between the operator's look and its stop request is short. With @-C0@ GHC switches
-- threads wherever it can, so there too; that can be said only as a program begins.
attack :: IO ()
attack = do
  again <- lookupEnv "ATTACK_AGAIN"
  when (isNothing again) $ do
    program <- getExecutablePath
    n <- getNumCapabilities
    executeFile program False ["LateRecovery", "+RTS", "-C0", "-N" ++ show n] (Just [("ATTACK_AGAIN", "yes")])
  boxes <- forM [1 .. 3000] $ \k -> do
    box <- newEmptyMVar
    box <$ forkIO (one k >>= putMVar box)
  ends <- catMaybes <$> mapM takeMVar boxes
  let late = length (filter id ends)
  putStrLn (show (length ends) ++ " recoveries, " ++ show late ++ " late")
  promise (show late ++ " of " ++ show (length ends) ++ " recoveries waited for the sensor") (late == 0)

-- | Whether the sensor had ended when the recovery began, if it did.
one :: Int -> IO (Maybe Bool)
one k = do
  low <- newTVarIO False
  deaf <- newTVarIO False
  isFirst <- newIORef True
  deafOver <- newIORef False
  begun <- newIORef Nothing
  let reading = do
        first <- atomicModifyIORef' isFirst ((,) False)
        unless first $ uninterruptibleMask_ (atomically (writeTVar deaf True) >> milliseconds 4000 >> writeIORef deafOver True)
      task = do
        over <- readIORef begun
        when (isNothing over) $ do
          atomically (readTVar deaf >>= check)
          atomically (readTVar low >>= check)
          mapM_ (const yield) [1 .. k `mod` 10]
          failed
      recovery = do
        readIORef deafOver >>= writeIORef begun . Just
        atomically (writeTVar low False)
  _ <- forkIO $ do
    atomically (readTVar deaf >>= check)
    threadDelay (1000 + 100 * k)
    atomically (writeTVar low True)
  _ <- try (monitor (const <$> watching (readTVar low) <*> polling 0.0005 reading) recovery task) :: IO (Either SomeException ())
  readIORef begun
