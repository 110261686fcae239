-- | The task ends just when the condition becomes true, and the sensor is uninterruptible
-- for 4 s. Expected: the recovery begins at once, and does not wait for the sensor to stop.
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

-- | The time between the operator's read and its stop request is short. With @-C0@ GHC
-- switches threads wherever it can, so there too; that option is only read when a program
-- starts.
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

-- | Whether the sensor had ended when the recovery began, if the recovery began.
one :: Int -> IO (Maybe Bool)
one k = do
  low <- newTVarIO False
  sensorMasked <- newTVarIO False
  isFirst <- newIORef True
  sensorOver <- newIORef False
  begun <- newIORef Nothing
  let reading = do
        first <- atomicModifyIORef' isFirst ((,) False)
        unless first . uninterruptibleMask_ $ do
          atomically (writeTVar sensorMasked True)
          milliseconds 4000
          writeIORef sensorOver True
      task = do
        over <- readIORef begun
        when (isNothing over) $ do
          atomically (readTVar sensorMasked >>= check)
          atomically (readTVar low >>= check)
          mapM_ (const yield) [1 .. k `mod` 10]
          failed
      recovery = do
        readIORef sensorOver >>= writeIORef begun . Just
        atomically (writeTVar low False)
  _ <- forkIO $ do
    atomically (readTVar sensorMasked >>= check)
    threadDelay (1000 + 100 * k)
    atomically (writeTVar low True)
  let sensor = const <$> watching (readTVar low) <*> polling 0.0005 reading
  _ <- try (monitor sensor recovery task) :: IO (Either SomeException ())
  readIORef begun
