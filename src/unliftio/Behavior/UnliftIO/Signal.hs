-- |
-- "Behavior.Signal" in a monad of your own ("Behavior.UnliftIO"). Import it qualified.
--
-- > run (op a b)  =  Behavior.Signal.op (run a) (run b)
--
-- (The two sides are the same for every way to run the monad in 'IO'.) See "Behavior.Signal" for what each operator
-- does; what is not a behaviour is that module's own.
module Behavior.UnliftIO.Signal
  ( -- * Signals
    Signal
  , watching
  , polling

    -- ** Filtering
  , debounce
  , throttle
  , hysteresis
  , changes

    -- ** Detecting stale readings
  , staleAfter
  , olderThan

    -- ** Naming
  , named
  , namedWith

    -- ** Sharing between operators
  , withShared

    -- * Reactive operators

    -- ** Interrupting
  , rSelect
  , monitor
  , insteadWhen

    -- ** Pausing
  , pausedWhile
  , stoppedWhile

    -- ** Many branches
  , switch
  , teleoReactive

    -- ** Reading, waiting for a condition, and requiring one
  , read
  , waitUntil
  , waitUntilJust
  , whileHolding
  ) where

import Control.Monad.IO.Unlift (MonadIO (..), MonadUnliftIO, withRunInIO)
import Prelude hiding (read)

import Behavior (Seconds)
import Behavior.Signal
  ( Signal
  , changes
  , debounce
  , hysteresis
  , named
  , namedWith
  , olderThan
  , staleAfter
  , throttle
  , watching
  )
import qualified Behavior.Signal as IO

-- | 'Behavior.Signal.polling'. The sensor is read in the environment of the caller.
--
-- > run (polling s a)  =  pure (Behavior.Signal.polling s (run a))
--
-- @since 0.1.0.0
polling :: MonadUnliftIO m => Seconds -> m a -> m (Signal a)
polling seconds act = withRunInIO $ \run -> pure (IO.polling seconds (run act))

-- | 'Behavior.Signal.withShared'.
--
-- > run (withShared s f)  =  Behavior.Signal.withShared s (run . f)
--
-- @since 0.1.0.0
withShared :: MonadUnliftIO m => Signal a -> (Signal a -> m b) -> m b
withShared signal body = withRunInIO $ \run -> IO.withShared signal (run . body)

-- | 'Behavior.Signal.rSelect'.
--
-- > run (rSelect c a b)  =  Behavior.Signal.rSelect c (run a) (run b)
--
-- @since 0.1.0.0
rSelect :: MonadUnliftIO m => Signal Bool -> m a -> m a -> m a
rSelect condition left right = withRunInIO $ \run -> IO.rSelect condition (run left) (run right)

-- | 'Behavior.Signal.monitor'.
--
-- > run (monitor c r a)  =  Behavior.Signal.monitor c (run r) (run a)
--
-- @since 0.1.0.0
monitor :: MonadUnliftIO m => Signal Bool -> m () -> m a -> m a
monitor condition recovery task = withRunInIO $ \run -> IO.monitor condition (run recovery) (run task)

-- | 'Behavior.Signal.insteadWhen'.
--
-- > run (insteadWhen c e a)  =  Behavior.Signal.insteadWhen c (run e) (run a)
--
-- @since 0.1.0.0
insteadWhen :: MonadUnliftIO m => Signal Bool -> m a -> m a -> m a
insteadWhen condition emergency act = withRunInIO $ \run -> IO.insteadWhen condition (run emergency) (run act)

-- | 'Behavior.Signal.pausedWhile'.
--
-- > run (pausedWhile c p r a)  =  Behavior.Signal.pausedWhile c (run p) (run r) (run a)
--
-- @since 0.1.0.0
pausedWhile :: MonadUnliftIO m => Signal Bool -> m () -> m () -> m a -> m a
pausedWhile condition pause resume act =
  withRunInIO $ \run -> IO.pausedWhile condition (run pause) (run resume) (run act)

-- | 'Behavior.Signal.stoppedWhile'.
--
-- > run (stoppedWhile c a)  =  Behavior.Signal.stoppedWhile c (run a)
--
-- @since 0.1.0.0
stoppedWhile :: MonadUnliftIO m => Signal Bool -> m a -> m a
stoppedWhile condition act = withRunInIO $ \run -> IO.stoppedWhile condition (run act)

-- | 'Behavior.Signal.switch'.
--
-- > run (switch s f)  =  Behavior.Signal.switch s (run . f)
--
-- @since 0.1.0.0
switch :: (Eq k, MonadUnliftIO m) => Signal k -> (k -> m a) -> m a
switch signal act = withRunInIO $ \run -> IO.switch signal (run . act)

-- | 'Behavior.Signal.teleoReactive'.
--
-- > run (teleoReactive rules)  =  Behavior.Signal.teleoReactive (map (fmap run) rules)
--
-- @since 0.1.0.0
teleoReactive :: MonadUnliftIO m => [(Signal Bool, m a)] -> m a
teleoReactive rules = withRunInIO $ \run -> IO.teleoReactive (map (fmap run) rules)

-- | 'Behavior.Signal.read'.
--
-- > run (read s)  =  Behavior.Signal.read s
--
-- @since 0.1.0.0
read :: MonadIO m => Signal a -> m a
read = liftIO . IO.read

-- | 'Behavior.Signal.waitUntil'.
--
-- > run (waitUntil c)  =  Behavior.Signal.waitUntil c
--
-- @since 0.1.0.0
waitUntil :: MonadIO m => Signal Bool -> m ()
waitUntil = liftIO . IO.waitUntil

-- | 'Behavior.Signal.waitUntilJust'.
--
-- > run (waitUntilJust s)  =  Behavior.Signal.waitUntilJust s
--
-- @since 0.1.0.0
waitUntilJust :: MonadIO m => Signal (Maybe a) -> m a
waitUntilJust = liftIO . IO.waitUntilJust

-- | 'Behavior.Signal.whileHolding'.
--
-- > run (whileHolding c a)  =  Behavior.Signal.whileHolding c (run a)
--
-- @since 0.1.0.0
whileHolding :: MonadUnliftIO m => Signal Bool -> m a -> m a
whileHolding condition act = withRunInIO $ \run -> IO.whileHolding condition (run act)
