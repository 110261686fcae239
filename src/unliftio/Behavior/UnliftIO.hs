-- |
-- The language in a monad of your own: "Behavior", for every monad that is @ReaderT@ over 'IO', with or without a
-- newtype ('MonadUnliftIO').
--
-- Each module here is to be imported in place of the one whose name it has behind @Behavior@, and exports the same
-- names:
--
-- > import Behavior.UnliftIO
-- > import Behavior.UnliftIO.Parallel
-- > import Behavior.UnliftIO.Signal (Signal)
-- > import qualified Behavior.UnliftIO.Signal as Signal
-- > import Behavior.UnliftIO.STM
-- > import Behavior.UnliftIO.Time
--
-- An operator runs the behaviours that it is given in the monad, with its environment, and is otherwise that
-- of the original module, where its documentation is. For every way @run@ to run the monad in 'IO':
--
-- > run (op a b)  =  Behavior.op (run a) (run b)
--
-- What is not a behaviour (types, signals, transactions) is the original itself. A whole in the monad is simulated
-- by the original modules: @simulate (runReaderT mission robot)@.
--
-- >>> import Control.Monad.IO.Class (liftIO)
-- >>> import Control.Monad.Trans.Reader (ReaderT (..), ask)
-- >>> let enter door = if door == "front" then failWith "locked" else putStrLn ("through the " ++ door)
-- >>> let open = ask >>= liftIO . enter :: ReaderT String IO ()
-- >>> runReaderT (open ? liftIO (putStrLn "knock")) "front"
-- knock
module Behavior.UnliftIO
  ( -- * Behaviours
    Behavior
  , runBehavior
  , sleep
  , Seconds

    -- * What to do when something fails
  , fallback
  , (?)
  , fallbackWith
  , fallbackOver
  , attempt

    -- * Doing two things at once
  , parallel
  , (|||)
  , both

    -- * Reacting while something runs
  , rSelect
  , monitor

    -- * Going on where it was interrupted
  , resumable
  , resumableFor

    -- * Failing
  , failed
  , failWith
  , failingOn
  , Failed (..)
  , BehaviorFailed (..)
  , failurePath
  , behaviorFailedToException
  , behaviorFailedFromException

    -- * What to do about a fault
  , tryAny
  , catchAny

    -- * Faults met while stopping
  , StoppedWithFault (..)
  ) where

import Control.Exception (Exception, SomeException)
import Control.Monad.IO.Unlift (MonadIO (..), MonadUnliftIO, withRunInIO)
import Data.Map.Lazy (Map)

import Behavior
  ( Behavior
  , BehaviorFailed (..)
  , Failed (..)
  , Seconds
  , StoppedWithFault (..)
  , behaviorFailedFromException
  , behaviorFailedToException
  , failWith
  , failed
  , failurePath
  )
import qualified Behavior as IO
import Behavior.STM (STM, TVar)

-- | 'Behavior.runBehavior'.
--
-- > run (runBehavior a)  =  Behavior.runBehavior (run a)
--
-- @since 0.1.0.0
runBehavior :: MonadUnliftIO m => m a -> m a
runBehavior act = withRunInIO $ \run -> IO.runBehavior (run act)

-- | 'Behavior.sleep'.
--
-- > run (sleep s)  =  Behavior.sleep s
--
-- @since 0.1.0.0
sleep :: MonadIO m => Seconds -> m ()
sleep = liftIO . IO.sleep

-- | 'Behavior.fallback'.
--
-- > run (fallback a b)  =  Behavior.fallback (run a) (run b)
--
-- @since 0.1.0.0
fallback :: MonadUnliftIO m => m a -> m a -> m a
fallback first second = withRunInIO $ \run -> IO.fallback (run first) (run second)

-- | 'Behavior.?'.
--
-- > run (a ? b)  =  run a Behavior.? run b
--
-- @since 0.1.0.0
(?) :: MonadUnliftIO m => m a -> m a -> m a
(?) = fallback

infixr 3 ?

-- | 'Behavior.fallbackWith'.
--
-- > run (fallbackWith a b)  =  Behavior.fallbackWith (run a) (run . b)
--
-- @since 0.1.0.0
fallbackWith :: MonadUnliftIO m => m a -> (BehaviorFailed -> m a) -> m a
fallbackWith first second = withRunInIO $ \run -> IO.fallbackWith (run first) (run . second)

-- | 'Behavior.fallbackOver'.
--
-- > run (fallbackOver xs a)  =  Behavior.fallbackOver xs (run . a)
--
-- @since 0.1.0.0
fallbackOver :: (Foldable t, MonadUnliftIO m) => t x -> (x -> m a) -> m a
fallbackOver inputs act = withRunInIO $ \run -> IO.fallbackOver inputs (run . act)

-- | 'Behavior.attempt'.
--
-- > run (attempt n a)  =  Behavior.attempt n (run a)
--
-- @since 0.1.0.0
attempt :: MonadUnliftIO m => Int -> m a -> m a
attempt n act = withRunInIO $ \run -> IO.attempt n (run act)

-- | 'Behavior.parallel'.
--
-- > run (parallel a b)  =  Behavior.parallel (run a) (run b)
--
-- @since 0.1.0.0
parallel :: MonadUnliftIO m => m a -> m b -> m ()
parallel left right = withRunInIO $ \run -> IO.parallel (run left) (run right)

-- | 'Behavior.|||'.
--
-- > run (a ||| b)  =  run a Behavior.||| run b
--
-- @since 0.1.0.0
(|||) :: MonadUnliftIO m => m a -> m b -> m ()
(|||) = parallel

infixr 2 |||

-- | 'Behavior.both'.
--
-- > run (both a b)  =  Behavior.both (run a) (run b)
--
-- @since 0.1.0.0
both :: MonadUnliftIO m => m a -> m b -> m ()
both left right = withRunInIO $ \run -> IO.both (run left) (run right)

-- | 'Behavior.rSelect'.
--
-- > run (rSelect c a b)  =  Behavior.rSelect (run c) (run a) (run b)
--
-- @since 0.1.0.0
rSelect :: MonadUnliftIO m => m Bool -> m a -> m a -> m a
rSelect test left right = withRunInIO $ \run -> IO.rSelect (run test) (run left) (run right)

-- | 'Behavior.monitor'.
--
-- > run (monitor c r a)  =  Behavior.monitor (run c) (run r) (run a)
--
-- @since 0.1.0.0
monitor :: MonadUnliftIO m => m Bool -> m () -> m a -> m a
monitor test recovery task = withRunInIO $ \run -> IO.monitor (run test) (run recovery) (run task)

-- | 'Behavior.resumable'.
--
-- > run (resumable left f)  =  Behavior.resumable left (run . f)
--
-- @since 0.1.0.0
resumable :: MonadUnliftIO m => TVar [a] -> (a -> m ()) -> m ()
resumable left act = withRunInIO $ \run -> IO.resumable left (run . act)

-- | 'Behavior.resumableFor'.
--
-- > run (resumableFor progress key steps f)  =  Behavior.resumableFor progress key steps (run . f)
--
-- @since 0.1.0.0
resumableFor :: (Ord k, MonadUnliftIO m) => TVar (Map k [a]) -> k -> [a] -> (a -> m ()) -> m (STM ())
resumableFor progress key steps act = withRunInIO $ \run -> IO.resumableFor progress key steps (run . act)

-- | 'Behavior.failingOn'.
--
-- > run (failingOn p a)  =  Behavior.failingOn p (run a)
--
-- @since 0.1.0.0
failingOn :: (Exception e, MonadUnliftIO m) => (e -> Bool) -> m a -> m a
failingOn chosen act = withRunInIO $ \run -> IO.failingOn chosen (run act)

-- | 'Behavior.tryAny'.
--
-- > run (tryAny a)  =  Behavior.tryAny (run a)
--
-- @since 0.1.0.0
tryAny :: MonadUnliftIO m => m a -> m (Either SomeException a)
tryAny act = withRunInIO $ \run -> IO.tryAny (run act)

-- | 'Behavior.catchAny'.
--
-- > run (catchAny a h)  =  Behavior.catchAny (run a) (run . h)
--
-- @since 0.1.0.0
catchAny :: MonadUnliftIO m => m a -> (SomeException -> m a) -> m a
catchAny act handler = withRunInIO $ \run -> IO.catchAny (run act) (run . handler)
