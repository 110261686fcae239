{-# LANGUAGE CPP #-}

-- |
-- "Behavior.STM" in a monad of your own ("Behavior.UnliftIO"): all of stm, with what is not a transaction lifted.
--
-- > run (op a b)  =  Behavior.STM.op (run a) (run b)
--
-- (The two sides are the same for every way to run the monad in 'IO'.) See "Behavior.STM" for what each operator
-- does; what is not a behaviour is that module's own.
module Behavior.UnliftIO.STM
  ( atomically
  , withTSem

    -- * Variables, outside of a transaction
  , newTVarIO
  , readTVarIO
  , newTMVarIO
  , newEmptyTMVarIO
  , newTChanIO
  , newBroadcastTChanIO
  , newTQueueIO
  , newTBQueueIO
  , mkWeakTVar
  , mkWeakTMVar
#ifndef __HADDOCK_VERSION__
    -- Haddock would list the whole package here.
  , module Control.Concurrent.STM
  , module Control.Concurrent.STM.TSem
#endif
  ) where

import Control.Concurrent.STM hiding
  ( atomically
  , registerDelay
  , newTVarIO
  , readTVarIO
  , newTMVarIO
  , newEmptyTMVarIO
  , newTChanIO
  , newBroadcastTChanIO
  , newTQueueIO
  , newTBQueueIO
  , mkWeakTVar
  , mkWeakTMVar
  )
import Control.Concurrent.STM.TSem
import Control.Monad.IO.Unlift (MonadIO (..), MonadUnliftIO, withRunInIO)
import Numeric.Natural (Natural)
import System.Mem.Weak (Weak)

import qualified Behavior.STM as IO

-- | 'Behavior.STM.atomically'.
--
-- > run (atomically t)  =  Behavior.STM.atomically t
--
-- @since 0.1.0.0
atomically :: MonadIO m => STM a -> m a
atomically = liftIO . IO.atomically

-- | 'Behavior.STM.withTSem'.
--
-- > run (withTSem s a)  =  Behavior.STM.withTSem s (run a)
--
-- @since 0.1.0.0
withTSem :: MonadUnliftIO m => TSem -> m a -> m a
withTSem semaphore act = withRunInIO $ \run -> IO.withTSem semaphore (run act)

-- | 'Control.Concurrent.STM.newTVarIO'.
--
-- @since 0.1.0.0
newTVarIO :: MonadIO m => a -> m (TVar a)
newTVarIO = liftIO . IO.newTVarIO

-- | 'Control.Concurrent.STM.readTVarIO'.
--
-- @since 0.1.0.0
readTVarIO :: MonadIO m => TVar a -> m a
readTVarIO = liftIO . IO.readTVarIO

-- | 'Control.Concurrent.STM.newTMVarIO'.
--
-- @since 0.1.0.0
newTMVarIO :: MonadIO m => a -> m (TMVar a)
newTMVarIO = liftIO . IO.newTMVarIO

-- | 'Control.Concurrent.STM.newEmptyTMVarIO'.
--
-- @since 0.1.0.0
newEmptyTMVarIO :: MonadIO m => m (TMVar a)
newEmptyTMVarIO = liftIO IO.newEmptyTMVarIO

-- | 'Control.Concurrent.STM.newTChanIO'.
--
-- @since 0.1.0.0
newTChanIO :: MonadIO m => m (TChan a)
newTChanIO = liftIO IO.newTChanIO

-- | 'Control.Concurrent.STM.newBroadcastTChanIO'.
--
-- @since 0.1.0.0
newBroadcastTChanIO :: MonadIO m => m (TChan a)
newBroadcastTChanIO = liftIO IO.newBroadcastTChanIO

-- | 'Control.Concurrent.STM.newTQueueIO'.
--
-- @since 0.1.0.0
newTQueueIO :: MonadIO m => m (TQueue a)
newTQueueIO = liftIO IO.newTQueueIO

-- | 'Control.Concurrent.STM.newTBQueueIO'.
--
-- @since 0.1.0.0
newTBQueueIO :: MonadIO m => Natural -> m (TBQueue a)
newTBQueueIO = liftIO . IO.newTBQueueIO

-- | 'Control.Concurrent.STM.mkWeakTVar'.
--
-- > run (mkWeakTVar v a)  =  Control.Concurrent.STM.mkWeakTVar v (run a)
--
-- @since 0.1.0.0
mkWeakTVar :: MonadUnliftIO m => TVar a -> m () -> m (Weak (TVar a))
mkWeakTVar var act = withRunInIO $ \run -> IO.mkWeakTVar var (run act)

-- | 'Control.Concurrent.STM.mkWeakTMVar'.
--
-- > run (mkWeakTMVar v a)  =  Control.Concurrent.STM.mkWeakTMVar v (run a)
--
-- @since 0.1.0.0
mkWeakTMVar :: MonadUnliftIO m => TMVar a -> m () -> m (Weak (TMVar a))
mkWeakTMVar var act = withRunInIO $ \run -> IO.mkWeakTMVar var (run act)
