-- |
-- "Behavior.Time" in a monad of your own ("Behavior.UnliftIO").
--
-- > run (op a b)  =  Behavior.Time.op (run a) (run b)
--
-- (The two sides are the same for every way to run the monad in 'IO'.) See "Behavior.Time" for what each operator
-- does; what is not a behaviour is that module's own.
module Behavior.UnliftIO.Time
  ( -- * The clock
    Seconds
  , now

    -- * Waiting
  , sleep
  , sleepUntil
  , sleepForever
  , checkpoint

    -- * Again
  , retrying
  , retryingWith
  , every

    -- * Limits
  , timeout
  , timeoutAt
  , TimedOut (..)
  , cleanupWithin

    -- * Going on without a behaviour that does not stop
  , abandoning
  , abandonedCount
  , Abandoned (..)
  ) where

import Control.Monad.IO.Unlift (MonadIO (..), MonadUnliftIO, withRunInIO)

import Behavior (BehaviorFailed, Seconds)
import Behavior.Time (Abandoned (..), TimedOut (..))
import qualified Behavior.Time as IO
import Behavior.UnliftIO (sleep)

-- | 'Behavior.Time.now'.
--
-- > run now  =  Behavior.Time.now
--
-- @since 0.1.0.0
now :: MonadIO m => m Seconds
now = liftIO IO.now

-- | 'Behavior.Time.sleepUntil'.
--
-- > run (sleepUntil t)  =  Behavior.Time.sleepUntil t
--
-- @since 0.1.0.0
sleepUntil :: MonadIO m => Seconds -> m ()
sleepUntil = liftIO . IO.sleepUntil

-- | 'Behavior.Time.sleepForever'.
--
-- > run sleepForever  =  Behavior.Time.sleepForever
--
-- @since 0.1.0.0
sleepForever :: MonadIO m => m a
sleepForever = liftIO IO.sleepForever

-- | 'Behavior.Time.checkpoint'.
--
-- > run checkpoint  =  Behavior.Time.checkpoint
--
-- @since 0.1.0.0
checkpoint :: MonadIO m => m ()
checkpoint = liftIO IO.checkpoint

-- | 'Behavior.Time.retrying'.
--
-- > run (retrying ds a)  =  Behavior.Time.retrying ds (run a)
--
-- @since 0.1.0.0
retrying :: MonadUnliftIO m => [Seconds] -> m a -> m a
retrying delays act = withRunInIO $ \run -> IO.retrying delays (run act)

-- | 'Behavior.Time.retryingWith'.
--
-- > run (retryingWith f ds a)  =  Behavior.Time.retryingWith (run . f) ds (run a)
--
-- @since 0.1.0.0
retryingWith :: MonadUnliftIO m => (BehaviorFailed -> m ()) -> [Seconds] -> m a -> m a
retryingWith report delays act = withRunInIO $ \run -> IO.retryingWith (run . report) delays (run act)

-- | 'Behavior.Time.every'.
--
-- > run (every s a)  =  Behavior.Time.every s (run a)
--
-- @since 0.1.0.0
every :: MonadUnliftIO m => Seconds -> m a -> m b
every seconds act = withRunInIO $ \run -> IO.every seconds (run act)

-- | 'Behavior.Time.timeout'.
--
-- > run (timeout s a)  =  Behavior.Time.timeout s (run a)
--
-- @since 0.1.0.0
timeout :: MonadUnliftIO m => Seconds -> m a -> m a
timeout seconds act = withRunInIO $ \run -> IO.timeout seconds (run act)

-- | 'Behavior.Time.timeoutAt'.
--
-- > run (timeoutAt t a)  =  Behavior.Time.timeoutAt t (run a)
--
-- @since 0.1.0.0
timeoutAt :: MonadUnliftIO m => Seconds -> m a -> m a
timeoutAt end act = withRunInIO $ \run -> IO.timeoutAt end (run act)

-- | 'Behavior.Time.cleanupWithin'.
--
-- > run (cleanupWithin s a)  =  Behavior.Time.cleanupWithin s (run a)
--
-- @since 0.1.0.0
cleanupWithin :: MonadUnliftIO m => Seconds -> m a -> m (Maybe a)
cleanupWithin seconds act = withRunInIO $ \run -> IO.cleanupWithin seconds (run act)

-- | 'Behavior.Time.abandoning'.
--
-- > run (abandoning s a)  =  Behavior.Time.abandoning s (run a)
--
-- @since 0.1.0.0
abandoning :: MonadUnliftIO m => Seconds -> m a -> m a
abandoning seconds act = withRunInIO $ \run -> IO.abandoning seconds (run act)

-- | 'Behavior.Time.abandonedCount'.
--
-- > run abandonedCount  =  Behavior.Time.abandonedCount
--
-- @since 0.1.0.0
abandonedCount :: MonadIO m => m Int
abandonedCount = liftIO IO.abandonedCount
